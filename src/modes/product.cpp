#include "modes/product.hpp"

#include <algorithm>

namespace espalier::modes {

namespace {

constexpr std::int64_t kRows = 1024;
// Vectors that are multiplied at a time: a cache line of each row of x.
constexpr Index kWidth = 8;

}  // namespace

Product::Product(const SparseMatrix& lower) : n_(lower.rows), first_(static_cast<std::size_t>(lower.rows) + 1, 0) {
  const auto each = [&](const auto& use) {
    for (Index j = 0; j < lower.cols; ++j)
      for (Offset p = lower.col_ptr[static_cast<std::size_t>(j)]; p < lower.col_ptr[static_cast<std::size_t>(j) + 1];
           ++p) {
        const Index i = lower.row_ind[static_cast<std::size_t>(p)];
        const double a = lower.values[static_cast<std::size_t>(p)];
        if (a == 0) continue;
        use(i, j, a);
        if (i != j) use(j, i, a);
      }
  };
  each([&](Index i, Index, double) { ++first_[static_cast<std::size_t>(i) + 1]; });
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  column_.resize(static_cast<std::size_t>(first_.back()));
  value_.resize(column_.size());
  std::vector<Offset> next(first_.begin(), first_.end() - 1);
  each([&](Index i, Index j, double a) {
    const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(i)]++);
    column_[at] = j;
    value_[at] = a;
  });
}

void Product::apply(base::ThreadPool& pool, const double* x, double* y, Index columns) const {
  const auto n = static_cast<std::size_t>(n_);
  std::vector<double> packed(n * static_cast<std::size_t>(std::min(columns, kWidth)));
  for (Index c = 0; c < columns; c += kWidth) {
    const auto width = static_cast<std::size_t>(std::min(kWidth, columns - c));
    const double* from = x + n * static_cast<std::size_t>(c);
    double* to = y + n * static_cast<std::size_t>(c);
    pool.for_each_range(n_, kRows, [&](std::int64_t begin, std::int64_t end) {
      for (std::size_t k = 0; k < width; ++k)
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
          packed[i * width + k] = from[k * n + i];
    });
    const auto rows = [&](auto size, std::int64_t begin, std::int64_t end) {
      for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
        double sum[kWidth] = {};
        for (auto p = static_cast<std::size_t>(first_[i]); p < static_cast<std::size_t>(first_[i + 1]); ++p) {
          const double* v = packed.data() + static_cast<std::size_t>(column_[p]) * size;
          for (std::size_t k = 0; k < size; ++k) sum[k] += value_[p] * v[k];
        }
        for (std::size_t k = 0; k < size; ++k) to[k * n + i] = sum[k];
      }
    };
    pool.for_each_range(n_, kRows, [&](std::int64_t begin, std::int64_t end) {
      if (width == kWidth)
        rows(std::integral_constant<std::size_t, kWidth>{}, begin, end);
      else
        rows(width, begin, end);
    });
  }
}

}  // namespace espalier::modes
