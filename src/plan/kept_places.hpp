/// \file
/// Memory of a plan for a changed pattern, where fronts that are the same keep their places: what a factorization has
/// left there is of use to the next one.
#pragma once

#include <span>

#include "plan/changed_plan.hpp"
#include "plan/plan.hpp"

namespace espalier::plan {

/// In the place of plan_memory(). Fronts that are the same as one of `before` keep their places, others take what these
/// leave free, or come behind.
/// @pre plan.tasks are listed. @param same  see KeptEntries
/// @returns false, and the plan has no places: where these plans give places to others (none keeps contributions, or
///          several devices, a border), have other arrays, where there is no more room
///          (elements_with_room()), or far less is needed than was
bool place_as_before(Plan& plan, const Plan& before, std::span<const Index> same);

/// Fronts of `plan` whose numbers are those of one of `before`, if entries have the same values and all below are so,
/// too: they have the same pivots, rows, entries and children, and lie in the same places, where parents that are made
/// again find what they have left. FrontsBefore::front stays empty.
FrontsBefore fronts_that_stay(const Plan& plan, const Plan& before, std::span<const Index> same);

}  // namespace espalier::plan
