/// \file
/// A run of out-of-core plans that makes some of their units again, and leaves the others as they are in the store.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "out_of_core/plan.hpp"

namespace espalier::out_of_core {

/// All operations keep their numbers and their waits; those of units that are kept do nothing. Where a unit that is
/// made reads what a kept one has left in the arena of its device, that is brought from the store in the place of the
/// operation that would have made it: from there on the plan gives that place to nobody else.
class PartialRun {
 public:
  /// Makes everything.
  PartialRun() = default;
  /// @param plans  of all devices, that keep contributions; they outlive the object
  /// @param reached  fronts; not 0: it has to be made. So have to be all of its unit, and all units above
  PartialRun(const plan::Plan& plan, std::span<const OutOfCorePlan> plans, std::span<const char> reached);

  [[nodiscard]] bool makes_all() const { return kept_.empty(); }
  /// @param op  of this device
  [[nodiscard]] bool makes(const Operation& op, Index device) const;
  /// Fronts; not 0: it is not made. Empty: all are.
  [[nodiscard]] const std::vector<char>& kept() const { return kept_; }
  /// What is to be brought in the place of an operation that is not made.
  [[nodiscard]] std::span<const LeftContribution> brought(const Operation& op, Index device) const;

 private:
  // The fronts of the unit that computes it.
  [[nodiscard]] std::span<const Index> fronts_of(const Operation& op, Index device) const;
  void make_again(std::span<const char> reached);

  const plan::Plan* plan_ = nullptr;
  std::span<const OutOfCorePlan> plans_;
  std::vector<char> kept_;
  std::vector<std::vector<LeftContribution>> brought_;  // devices; by rising `after`
};

}  // namespace espalier::out_of_core
