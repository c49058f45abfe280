#include "matrix/multiply.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "base/at.hpp"
#include "matrix/column_sweep.hpp"

namespace espalier::matrix {

namespace {

struct Sum {
  double value = 0;
  void add(double a, double x) { value += a * x; }
  void merge(const Sum& other) { value += other.value; }
};

}  // namespace

void multiply(const MatrixView& a, Transpose transpose, std::span<const double> x, std::span<double> y, Index columns,
              base::ThreadPool* pool) {
  const auto rows = at(rows_of(a, transpose)), cols = at(cols_of(a, transpose));
  const auto k = at(columns);
  if (columns < 0 || x.size() != cols * k || y.size() != rows * k)
    throw std::invalid_argument(fmt::format("multiply: op(A) is {} x {}, {} vectors: x has {} numbers, y {}", rows,
                                            cols, columns, x.size(), y.size()));
  if (a.values.empty() && a.nonzeros() > 0) throw std::invalid_argument("multiply: the matrix has no values");
  for (std::size_t c = 0; c < k; ++c) {
    const double* xc = x.data() + c * cols;
    double* yc = y.data() + c * rows;
    sum_columns<Sum>(
        a, static_cast<Index>(rows), pool,
        [&](Index begin, Index end, Sum* sums) { sweep_columns(a, transpose, xc, begin, end, sums); },
        [&](Index i, const Sum& sum) { yc[i] = sum.value; });
  }
}

}  // namespace espalier::matrix
