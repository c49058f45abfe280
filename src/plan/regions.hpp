/// \file
/// Which region of memory each front of a plan belongs to, and the sizes for which memory is planned.
#pragma once

#include <cstdint>
#include <vector>

#include "plan/plan.hpp"

namespace espalier::plan {

/// Fronts; 1: the front, or one below it, has wide tiles.
std::vector<char> wide_fronts(const Plan& plan);

/// Region 0 is all of it with one device. With several: 0 the top, 1 .. devices what each has for itself, then the
/// sub-trees that may be stolen.
struct Regions {
  std::vector<Index> of;             ///< fronts
  std::vector<std::int32_t> device;  ///< regions; where it lies
  std::int32_t first_stealable = 0;  ///< region
  /// Fronts; 1: taken before all others of the region. The front and all below it have narrow tiles.
  std::vector<char> narrow;
};

/// @param peer_access  false: devices do not reach each other's memory, so nothing can be stolen
Regions name_regions(const Plan& plan, bool peer_access);

/// Sizes of all fronts' arrays by PlanOptions::arrays.
/// @pre PlanOptions::arrays is given
ArraySizes array_sizes(const Plan& plan);
/// With several devices: by regions, the top left out.
ArraySizes array_sizes(const Plan& plan, const Regions& regions);

/// Elements of factors and of what fronts leave for their parents, by device. Of the top each has a copy of all
/// factors, and about an even part of the rest.
/// @pre PlanOptions::arrays is given, and memory is planned; of several devices, by regions
std::vector<Offset> elements_by_device(const Plan& plan);

}  // namespace espalier::plan
