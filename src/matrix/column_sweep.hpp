/// \file
/// One sweep over the entries of a matrix of any storage that sums op(A) x with any kind of accumulator. Used by the
/// sources of this folder only (a template whose body several sources instantiate).
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "base/parallel.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// Adds the entries of columns [begin, end) of `a`, times x, to `sums` (one accumulator per row of op(A)).
/// An accumulator has add(a, x) and merge(other).
template <class Accumulator>
[[gnu::always_inline]] inline void sweep_columns(const MatrixView& a, Transpose transpose, const double* x, Index begin,
                                                 Index end, Accumulator* sums) {
  const bool half = a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
  const bool gather = half || transpose != Transpose::no;   // entry (i, j) adds a_ij x_i to sum j
  const bool scatter = half || transpose == Transpose::no;  // entry (i, j) adds a_ij x_j to sum i
  const Offset* col_ptr = a.col_ptr.data();
  const Index* row_ind = a.row_ind.data();
  const double* values = a.values.data();
  for (Index j = begin; j < end; ++j) {
    Accumulator sum{};
    for (Offset p = col_ptr[j]; p < col_ptr[j + 1]; ++p) {
      const Index i = row_ind[p];
      if (scatter && !(half && i == j)) sums[i].add(values[p], x[j]);
      if (gather) sum.add(values[p], x[i]);
    }
    if (gather) sums[j].merge(sum);
  }
}

/// Columns [first[k], first[k + 1]) form the k-th range: at most 8 ranges of about equal numbers of entries, each of at
/// least 2^17 entries (some 0.2 ms of work, which pays for a vector of sums of its own).
inline std::vector<Index> column_ranges(const MatrixView& a) {
  constexpr Offset kLeastEntries = Offset{1} << 17;
  constexpr Offset kMostRanges = 8;
  const Offset ranges = std::clamp<Offset>(a.nonzeros() / kLeastEntries, 1, kMostRanges);
  std::vector<Index> first(static_cast<std::size_t>(ranges) + 1, a.cols);
  first[0] = 0;
  for (Offset k = 1; k < ranges; ++k) {
    const auto at = std::lower_bound(a.col_ptr.begin(), a.col_ptr.end(), a.nonzeros() / ranges * k) - a.col_ptr.begin();
    first[static_cast<std::size_t>(k)] =
        std::clamp(static_cast<Index>(at), first[static_cast<std::size_t>(k) - 1], a.cols);
  }
  return first;
}

/// Sums op(A) x with sweep(begin, end, sums) over all ranges and calls finish(row, sum) for every row.
template <class Accumulator, class Sweep, class Finish>
void sum_columns(const MatrixView& a, Index rows, base::ThreadPool* pool, const Sweep& sweep, const Finish& finish) {
  constexpr std::int64_t kRowsPerTask = 16384;
  const auto first = column_ranges(a);
  const auto n = static_cast<std::size_t>(rows);
  std::vector<std::vector<Accumulator>> sums(first.size() - 1);
  base::for_each(pool, static_cast<std::int64_t>(sums.size()), [&](std::int64_t k) {
    const auto range = static_cast<std::size_t>(k);
    sums[range].assign(n, Accumulator{});
    sweep(first[range], first[range + 1], sums[range].data());
  });
  base::for_each_range(pool, rows, kRowsPerTask, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t i = begin; i < end; ++i) {
      Accumulator sum = sums[0][static_cast<std::size_t>(i)];
      for (std::size_t k = 1; k < sums.size(); ++k) sum.merge(sums[k][static_cast<std::size_t>(i)]);
      finish(static_cast<Index>(i), sum);
    }
  });
}

/// Rows and columns of op(A).
inline Index rows_of(const MatrixView& a, Transpose t) { return t == Transpose::no ? a.rows : a.cols; }
inline Index cols_of(const MatrixView& a, Transpose t) { return t == Transpose::no ? a.cols : a.rows; }

}  // namespace espalier::matrix
