/// \file
/// Who does what in a solve with a factor of which a part lies on the device.
#pragma once

#include <vector>

#include "out_of_core/plan.hpp"

namespace espalier::out_of_core {

/// Whole sub-trees below the resident fronts, with about `share` of the numbers of the factor that are not resident,
/// never more: what the device does of them while the host does the others.
/// @param resident  ascending; with each front all above it
/// @returns their fronts, ascending
std::vector<Index> choose_streamed(const OutOfCoreLayout& layout, const std::vector<Index>& resident, double share);

}  // namespace espalier::out_of_core
