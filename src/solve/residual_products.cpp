// Products with the matrix of a residual operator, and operations on its vectors.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "solve/residual_rows.hpp"

namespace espalier::solve {

namespace {

constexpr std::int64_t kValuesPerRange = 16384;  // values of a vector per range of work
constexpr Index kProductLanes = 8;               // vectors in one pass of products

}  // namespace

void ResidualOperator::multiply(const double* x, double* y, bool transpose) const {
  if (numbers_ == base::Numbers::real)
    multiply_rows(x, y, transpose);
  else
    multiply_rows(base::as_complex(x), base::as_complex(y), transpose);
}

template <class Value>
void ResidualOperator::multiply_rows(const Value* x, Value* y, bool transpose) const {
  for_each_range([&](std::size_t, Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Value sum0 = 0;
      Value sum1 = 0;
      visit_row<Value>(
          i, transpose, [&](Value v, Index c) { sum0 += v * x[c]; }, [&](Value v, Index c) { sum1 += v * x[c]; });
      y[i] = sum0 + sum1;
    }
  });
}

void ResidualOperator::multiply_columns(const double* x, double* y, Index columns, bool transpose) const {
  if (columns == 1 || numbers_ != base::Numbers::real) return ResidualSpace::multiply_columns(x, y, columns, transpose);
  base::Buffer<double> packed(Offset{a_.rows} * kProductLanes, nullptr);
  for (Index first = 0; first < columns; first += kProductLanes) {
    const auto now = static_cast<std::size_t>(std::min(kProductLanes, columns - first));
    const Offset at = Offset{first} * a_.rows;
    multiply_pass(x + at, y + at, now, packed.data(), transpose);
  }
}

// Each lane does what multiply_rows() does.
void ResidualOperator::multiply_pass(const double* x, double* y, std::size_t count, double* packed,
                                     bool transpose) const {
  constexpr std::size_t lanes = kProductLanes;
  const auto n = static_cast<std::size_t>(a_.rows);
  pack(
      count, lanes, [&](std::size_t k) { return x + k * n; }, packed);
  for_each_range([&](std::size_t, Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      double sum0[lanes] = {}, sum1[lanes] = {};
      const auto add = [&](double v, Index c, double* sum) __attribute__((always_inline)) {
        const double* const xc = packed + static_cast<std::size_t>(c) * lanes;
        for (std::size_t k = 0; k < lanes; ++k) sum[k] += v * xc[k];
      };
      visit_row<double>(
          i, transpose, [&](double v, Index c) __attribute__((always_inline)) { add(v, c, sum0); },
          [&](double v, Index c) __attribute__((always_inline)) { add(v, c, sum1); });
      for (std::size_t k = 0; k < count; ++k) y[k * n + static_cast<std::size_t>(i)] = sum0[k] + sum1[k];
    }
  });
}

void ResidualOperator::combine(double a, const double* x, double b, double* y) const {
  pool_->for_each_range(size(), kValuesPerRange, [&](std::int64_t begin, std::int64_t end) {
    if (b == 0) {
      for (auto i = begin; i < end; ++i) y[i] = a * x[i];
    } else {
      for (auto i = begin; i < end; ++i) y[i] = a * x[i] + b * y[i];
    }
  });
}

void ResidualOperator::add_columns(const double* z, std::span<const double> factors, double* y) const {
  pool_->for_each_range(size(), kValuesPerRange, [&](std::int64_t begin, std::int64_t end) {
    const double* column = z;
    for (const double factor : factors) {
      if (factor != 0)
        for (auto i = begin; i < end; ++i) y[i] += factor * column[i];
      column += size();
    }
  });
}

double ResidualOperator::dot(const double* a, const double* b) const {
  std::vector<double> sums(static_cast<std::size_t>((size() + kValuesPerRange - 1) / kValuesPerRange), 0);
  pool_->for_each_range(size(), kValuesPerRange, [&](std::int64_t begin, std::int64_t end) {
    sums[static_cast<std::size_t>(begin / kValuesPerRange)] = std::inner_product(a + begin, a + end, b + begin, 0.0);
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

void ResidualOperator::copy(const double* from, double* to) const {
  pool_->for_each_range(size(), kValuesPerRange,
                        [&](std::int64_t begin, std::int64_t end) { std::copy(from + begin, from + end, to + begin); });
}

bool ResidualOperator::add(const double* from, double* to) const {
  std::atomic<bool> finite{true};
  pool_->for_each_range(size(), kValuesPerRange, [&](std::int64_t begin, std::int64_t end) {
    bool fine = true;
    for (auto i = begin; i < end; ++i) {
      fine = fine && std::isfinite(to[i]);
      to[i] += from[i];
    }
    if (!fine) finite = false;
  });
  return finite;
}

ResidualSpace::Vectors ResidualOperator::vectors(Index, Index columns) const {
  auto owner = std::make_shared<base::Buffer<double>>(Offset{size()} * columns, nullptr);
  double* data = owner->data();
  return {data, std::move(owner)};
}

Offset ResidualOperator::bytes() const { return rows_->bytes(); }

}  // namespace espalier::solve
