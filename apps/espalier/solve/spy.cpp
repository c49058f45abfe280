#include "solve/spy.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace espalier::cli {

Spy spy_of(const MatrixView& a, std::span<const Index> rows, std::span<const Index> columns) {
  Spy spy;
  spy.size = std::min<int>(a.rows, kMostSpy);
  if (spy.size == 0) return spy;
  const auto size = static_cast<std::size_t>(spy.size);
  std::vector<std::int64_t> counts(size * size, 0);
  const auto cell = [&](std::span<const Index> place, Index i) {
    const Index at = place.empty() ? i : place[static_cast<std::size_t>(i)];
    return static_cast<std::size_t>(Offset{at} * spy.size / a.rows);
  };
  const bool triangle = a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper ||
                        a.storage == Storage::hermitian_lower || a.storage == Storage::hermitian_upper;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset k = a.col_ptr[static_cast<std::size_t>(c)]; k < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++k) {
      const Index r = a.row_ind[static_cast<std::size_t>(k)];
      ++counts[cell(rows, r) * size + cell(columns, c)];
      ++spy.entries;
      if (!triangle || r == c) continue;
      ++counts[cell(rows, c) * size + cell(columns, r)];
      ++spy.entries;
    }
  const double most = std::log1p(static_cast<double>(*std::max_element(counts.begin(), counts.end())));
  for (const std::int64_t count : counts)
    spy.counts.push_back(
        count == 0 ? 0
                   : static_cast<unsigned char>(1 + std::lround(254 * std::log1p(static_cast<double>(count)) / most)));
  return spy;
}

}  // namespace espalier::cli
