/// \file
/// What the arrays of a plan take.
#pragma once

#include "plan/plan.hpp"

namespace espalier::plan {

/// Bytes. Of several ranks, `tree` is what all know alike, the rest the part of the plan's rank.
struct PlanBytes {
  Offset tree = 0;     ///< order, fronts: sizes, parents, owners, places in memory
  Offset rows = 0;     ///< of fronts, and their places in the parents
  Offset tiles = 0;    ///< where the entries of each begin
  Offset entries = 0;  ///< places of entries in tiles; of several ranks, which they are
  Offset tasks = 0;

  [[nodiscard]] Offset all() const { return tree + rows + tiles + entries + tasks; }
};

PlanBytes bytes_of(const Plan& plan);

}  // namespace espalier::plan
