/// \file
/// Sums by rows over a pattern that lies by columns.
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/at.hpp"
#include "base/parallel.hpp"
#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// body(column, begin, end) for the entries of each column, cut to ranges of rows. A range is one thread's and meets
/// its columns in their order: what is summed up by rows has the same bits for any number of threads.
/// @param p  by columns @param pool  null: the calling thread alone
template <class Body>
void for_each_row_range(const SparsePattern& p, base::ThreadPool* pool, const Body& body) {
  constexpr int kRangesPerThread = 4;
  constexpr Offset kFewEntries = 1 << 16;  // some 100 microseconds
  const int threads = p.nonzeros() < kFewEntries ? 1 : base::threads_of(pool);
  const std::int64_t ranges = threads == 1 ? 1 : kRangesPerThread * threads, each = (p.rows + ranges - 1) / ranges;
  base::for_each(threads == 1 ? nullptr : pool, ranges, [&](std::int64_t range) {
    const std::int64_t first = range * each, last = std::min<std::int64_t>(first + each, p.rows);
    for (Index column = 0; column < p.cols; ++column) {
      const auto begin = p.ind.begin() + p.ptr[at(column)];
      const auto end = p.ind.begin() + p.ptr[at(column) + 1];
      if (begin == end || *begin >= last || *(end - 1) < first) continue;
      const auto from = std::lower_bound(begin, end, first), to = std::lower_bound(from, end, last);
      if (from != to) body(column, from - p.ind.begin(), to - p.ind.begin());
    }
  });
}

}  // namespace espalier::dynamics
