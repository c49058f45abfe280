/// \file
/// Which devices work on which fronts when several factor out of core.
#pragma once

#include <cstdint>
#include <vector>

#include "plan/plan.hpp"

namespace espalier::out_of_core {

/// fronts; bit d: device d works on the front or on one above which it has a part of the work below.
using DeviceSets = std::vector<std::uint64_t>;

/// Subset mapping (Pothen and Sun 1993, "proportional mapping"): all devices share the root; where its sub-trees can be
/// parted such that every part gets devices in proportion to its work, they part, and so on down to single devices.
/// Neighbours in the tree stay on one device as far as balance allows, since what crosses devices crosses the link
/// twice.
/// @param speed  of each device, relative to the others; at most 64
DeviceSets share_fronts(const plan::Plan& plan, const std::vector<double>& speed);

}  // namespace espalier::out_of_core
