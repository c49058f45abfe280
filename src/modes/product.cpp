#include "modes/product.hpp"

#include <algorithm>

#include "matrix/row_index.hpp"

namespace espalier::modes {

namespace {

constexpr std::int64_t kRows = 1024;
// Vectors that are multiplied at a time: a cache line of each row of x.
constexpr Index kWidth = 8;

}  // namespace

Product::Product(const SparseMatrix& lower, base::ThreadPool& pool)
    : n_(lower.rows), first_(static_cast<std::size_t>(lower.rows) + 1, 0) {
  const matrix::RowIndex beside = matrix::index_rows(lower, pool);  // left of the diagonal
  // use(column, value) for the entries of a row, columns rising.
  const auto each = [&](std::int64_t row, auto use) {
    const auto i = static_cast<std::size_t>(row);
    const auto use_nonzero = [&](Index column, Offset source) {
      const double a = lower.values[static_cast<std::size_t>(source)];
      if (a != 0) use(column, a);
    };
    for (Offset k = beside.ptr[i]; k < beside.ptr[i + 1]; ++k)
      use_nonzero(beside.col.data()[k], beside.source.data()[k]);
    for (Offset k = lower.col_ptr[i]; k < lower.col_ptr[i + 1]; ++k)  // the diagonal, and what mirrors the column below
      use_nonzero(lower.row_ind[static_cast<std::size_t>(k)], k);
  };
  pool.for_each_range(n_, kRows, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = begin; i < end; ++i) each(i, [&](Index, double) { ++first_[static_cast<std::size_t>(i) + 1]; });
  });
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  column_ = base::Buffer<Index>(first_.back(), nullptr);
  value_ = base::Buffer<double>(first_.back(), nullptr);
  pool.for_each_range(n_, kRows, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = begin; i < end; ++i)
      each(i, [&, at = first_[static_cast<std::size_t>(i)]](Index column, double a) mutable {
        column_.data()[at] = column;
        value_.data()[at++] = a;
      });
  });
}

void Product::apply(base::ThreadPool& pool, const double* x, double* y, Index columns) const {
  const auto n = static_cast<std::size_t>(n_);
  const auto room = static_cast<Offset>(n) * std::min(columns, kWidth);
  if (packed_.size() < room) packed_ = base::Buffer<double>(room, nullptr);
  double* const packed = packed_.data();
  for (Index c = 0; c < columns; c += kWidth) {
    const auto width = static_cast<std::size_t>(std::min(kWidth, columns - c));
    const double* from = x + n * static_cast<std::size_t>(c);
    double* to = y + n * static_cast<std::size_t>(c);
    pool.for_each_range(n_, kRows, [&](std::int64_t begin, std::int64_t end) {
      for (std::size_t k = 0; k < width; ++k)
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
          packed[i * width + k] = from[k * n + i];
    });
    const Index* const column = column_.data();
    const double* const value = value_.data();
    const auto rows = [&](auto size, std::int64_t begin, std::int64_t end) {
      for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
        double sum[kWidth] = {};
        for (auto p = static_cast<std::size_t>(first_[i]); p < static_cast<std::size_t>(first_[i + 1]); ++p) {
          const double* v = packed + static_cast<std::size_t>(column[p]) * size;
          for (std::size_t k = 0; k < size; ++k) sum[k] += value[p] * v[k];
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
