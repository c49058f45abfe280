/// \file
/// The rows of a residual operator: loops that residuals and products share.
#pragma once

#include <algorithm>
#include <cstdint>

#include "solve/residual.hpp"

namespace espalier::solve {

inline constexpr std::int64_t kRowsPerRange = 2048;
inline constexpr Offset kAhead = 64;  // entries between asking for a scattered value and using it

// Calls use0 and use1 in turn with (value, column) for every entry of a row of op(A), in a fixed order: two chains of
// sums that the processor can follow side by side.
template <class Value, class Use0, class Use1>
[[gnu::always_inline]] inline void ResidualOperator::visit_row(Index row, bool transpose, Use0&& use0,
                                                               Use1&& use1) const {
  const bool general = a_.storage == Storage::general;
  const Value* const values = reinterpret_cast<const Value*>(values_.data());
  const bool turned = numbers_ == base::Numbers::hermitian;  // a column is the conjugate of the row
  const auto mirrored = [&](Offset q) __attribute__((always_inline)) {
    return turned ? base::conjugate(values[q]) : values[q];
  };
  if (!general || transpose) {
    Offset q = a_.col_ptr[row];
    const Offset end = a_.col_ptr[row + 1];
    for (; q + 1 < end; q += 2) {
      use0(mirrored(q), a_.row_ind[q]);
      use1(mirrored(q + 1), a_.row_ind[q + 1]);
    }
    if (q < end) use0(mirrored(q), a_.row_ind[q]);
  }
  const matrix::RowIndex& rows = *rows_;
  if (rows.ptr.empty() || (general && transpose)) return;
  Offset q = rows.ptr[row];
  const Offset end = rows.ptr[row + 1], last = rows.source.size() - 1;
  for (; q + 1 < end; q += 2) {
    __builtin_prefetch(&values[rows.source[std::min(q + kAhead, last)]]);
    __builtin_prefetch(&values[rows.source[std::min(q + kAhead + 1, last)]]);
    use0(values[rows.source[q]], rows.col[q]);
    use1(values[rows.source[q + 1]], rows.col[q + 1]);
  }
  if (q < end) use0(values[rows.source[q]], rows.col[q]);
}

// use(k, begin, end) for range k of the rows that are computed here.
template <class Use>
void ResidualOperator::for_each_range(const Use& use) const {
  pool_->for_each_range(end_row_ - first_row_, kRowsPerRange, [&](std::int64_t begin, std::int64_t end) {
    use(at(begin / kRowsPerRange), first_row_ + static_cast<Index>(begin), first_row_ + static_cast<Index>(end));
  });
}

// Row-major in groups of `lanes`; lanes without a column hold zeros.
template <class Column>
void ResidualOperator::pack(std::size_t count, std::size_t lanes, const Column& column, double* packed) const {
  const auto n = at(a_.rows);
  pool_->for_each_range(a_.rows, kRowsPerRange, [&](std::int64_t begin, std::int64_t end) {
    for (std::size_t first = 0; first < count; first += lanes)
      for (auto i = at(begin); i < at(end); ++i)
        for (std::size_t k = 0; k < lanes; ++k)
          packed[first * n + i * lanes + k] = first + k < count ? column(first + k)[i] : 0;
  });
}

}  // namespace espalier::solve
