/// \file
/// Which flags a task of the CUDA backend polls and sets, by the definitions in device/cuda/tables.hpp; parts left
/// aside.
#pragma once

#include <algorithm>
#include <cstdint>

#include "device/cuda/tables/device_plan.hpp"

namespace espalier {

class PlanFlags {
 public:
  explicit PlanFlags(const device::cuda::DevicePlan& tables) : device_(tables) {}

  /// Calls use(flag, front) for every flag that the task polls, and the front to which it belongs.
  template <class Use>
  void needed_flags(const device::cuda::FactorTask& t, Use&& use) const {
    const device::cuda::Front& f = device_.fronts[t.front];
    const int j = t.column;
    if (t.work == device::cuda::Work::whole) {
      children(f, 0, f.tiles, 0, f.tiles, use);
      return;
    }
    const int per_block = device::cuda::kRowBlock / f.width;
    const int first =
        t.block < f.pivot_blocks ? t.block * per_block : f.pivot_tiles + (t.block - f.pivot_blocks) * per_block;
    const bool pivot = j < f.pivot_tiles, diagonal = t.work == device::cuda::Work::diagonal;
    const int row = diagonal ? j : std::max(first, pivot ? j + 1 : j);
    const int end = diagonal ? j + 1 : std::min(first + per_block, t.block < f.pivot_blocks ? f.pivot_tiles : f.tiles);
    children(f, row, end, j, t.work == device::cuda::Work::two_columns ? j + 2 : j + 1, use);
    for (int k = 0; k < std::min(j, f.pivot_tiles); ++k) {
      use(f.flag(diagonal ? f.block_of_column(j) : t.block, k), t.front);
      use(f.flag(f.block_of_column(j), k), t.front);
    }
    if (pivot && !diagonal) use(f.diagonal_flag(j), t.front);
    if (pivot && t.work == device::cuda::Work::two_columns) {
      use(f.diagonal_flag(j + 1), t.front);
      use(f.flag(f.block_of_column(j), j), t.front);
    }
  }

  template <class Use>
  void children(const device::cuda::Front& f, int row, int row_end, int col, int col_end, Use&& use) const {
    for (int l = f.link_begin; l < f.link_end; ++l) {
      const device::cuda::Front& c = device_.fronts[device_.links[l].child];
      const std::int32_t* b = device_.bounds.data() + device_.links[l].bound;
      const int r0 = std::max(b[row], b[col]), r1 = b[row_end], c0 = b[col], c1 = b[col_end];
      if (r0 >= r1 || c0 >= c1) continue;
      for (int x = c0 / c.width; x <= (c1 - 1) / c.width; ++x)
        for (int y = r0 / device::cuda::kRowBlock; y <= (r1 - 1) / device::cuda::kRowBlock; ++y)
          if ((y + 1) * device::cuda::kRowBlock > x * c.width)
            use(c.flag(c.pivot_blocks + y, c.pivot_tiles + x), device_.links[l].child);
    }
  }

  std::int64_t own_flag(const device::cuda::FactorTask& t) const {
    const device::cuda::Front& f = device_.fronts[t.front];
    if (t.work == device::cuda::Work::diagonal) return f.diagonal_flag(t.column);
    if (t.work != device::cuda::Work::whole) return f.flag(t.block, t.column);
    return f.below > 0 ? f.flag(f.pivot_blocks, f.pivot_tiles) : f.diagonal_flag(0);
  }

  /// Calls use(flag) for each flag that the task sets.
  template <class Use>
  void own_flags(const device::cuda::FactorTask& t, Use&& use) const {
    use(own_flag(t));
    if (t.work == device::cuda::Work::two_columns) use(own_flag(t) + device_.fronts[t.front].blocks);
  }

 private:
  const device::cuda::DevicePlan& device_;
};

}  // namespace espalier
