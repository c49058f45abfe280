/// \file
/// Which region of memory each front of a plan belongs to, and how much its arrays take there.
#pragma once

#include <vector>

#include "device/cuda/tables/tables.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

inline constexpr Index kNarrowTiles = 32;  ///< width of the tile columns of small fronts
inline constexpr Index kWideTiles = 64;    ///< of all others

/// The shape of front f: all that follows from its layout alone.
Front shape_of(const plan::Plan& plan, Index f);

/// Elements in whole chunks.
inline Offset rounded(Offset x) { return (x + kChunk - 1) / kChunk * kChunk; }

/// Region 0 is all of it with one device. With several: 0 the top, 1 .. devices what each has for itself, then the
/// sub-trees that may be stolen.
struct Regions {
  std::vector<Index> of;             ///< fronts
  std::vector<std::int32_t> device;  ///< regions; where it lies
  std::int32_t first_stealable = 0;  ///< region
  std::vector<char> narrow;          ///< fronts; 1: the front and all below it have narrow tiles
};

/// @param peer_access  false: nothing can be stolen
Regions name_regions(const plan::Plan& plan, bool peer_access);

/// What memory is planned for (PlanOptions::array_sizes). With several devices: by regions, the top left out, for
/// devices that reach each other's memory.
plan::ArraySizes sizes_on_device(const plan::Plan& plan);
/// The same with the regions named.
plan::ArraySizes sizes_in_regions(const plan::Plan& plan, const Regions& regions);

}  // namespace espalier::device::cuda
