#include "matrix/residual.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "matrix/column_sweep.hpp"
#include "matrix/norms.hpp"

namespace espalier::matrix {

namespace {

// A sum in twice the working precision: value + correction. This source is compiled without contraction of products
// and sums into fused operations, on which the error-free transformations below depend.
struct DoubleSum {
  double value = 0;
  double correction = 0;
  [[gnu::always_inline]] void add(double a, double x) {
    const double product = a * x;
    const double error = __builtin_fma(a, x, -product);  // a x = product + error exactly
    add_pair(product, error);
  }
  [[gnu::always_inline]] void merge(const DoubleSum& other) { add_pair(other.value, other.correction); }
  // Knuth's sum: value + high = sum + (what rounding lost) exactly.
  [[gnu::always_inline]] void add_pair(double high, double low) {
    const double sum = value + high;
    const double part = sum - value;
    const double lost = (value - (sum - part)) + (high - part);
    value = sum;
    correction += lost + low;
  }
};

// The same with |a| |x|, in working precision: bounds need no more.
struct AbsoluteSum {
  double value = 0;
  void add(double a, double x) { value += std::abs(a) * std::abs(x); }
  void merge(const AbsoluteSum& other) { value += other.value; }
};

// Without a fused multiply-add in the instruction set of the build, libm's function (exact, some 3 times slower)
// serves.
void sweep_portable(const MatrixView& a, Transpose t, const double* x, Index begin, Index end, DoubleSum* sums) {
  sweep_columns(a, t, x, begin, end, sums);
}

#if defined(__x86_64__) && !defined(__FMA__)
[[gnu::target("avx2,fma")]] void sweep_fused(const MatrixView& a, Transpose t, const double* x, Index begin, Index end,
                                             DoubleSum* sums) {
  sweep_columns(a, t, x, begin, end, sums);
}
bool has_fused() { return __builtin_cpu_supports("fma") && __builtin_cpu_supports("avx2"); }
#else
constexpr auto sweep_fused = sweep_portable;  // the build's own instruction set has it, or is another processor's
bool has_fused() { return false; }
#endif

struct Extents {
  std::size_t rows, cols, columns;
};

Extents check(const MatrixView& a, std::span<const double> x, std::span<const double> b, Index columns, Transpose t) {
  const Extents s{static_cast<std::size_t>(rows_of(a, t)), static_cast<std::size_t>(cols_of(a, t)),
                  static_cast<std::size_t>(columns)};
  if (columns < 0 || x.size() != s.cols * s.columns || b.size() != s.rows * s.columns)
    throw std::invalid_argument(fmt::format("residual: op(A) is {} x {}, {} vectors: x has {} numbers, b {}", s.rows,
                                            s.cols, columns, x.size(), b.size()));
  if (a.values.empty() && a.nonzeros() > 0) throw std::invalid_argument("residual: the matrix has no values");
  return s;
}

// Largest magnitude; infinite when one is not finite.
double magnitude(std::span<const double> v) {
  double most = 0;
  for (const double c : v) {
    if (!std::isfinite(c)) return std::numeric_limits<double>::infinity();
    most = std::max(most, std::abs(c));
  }
  return most;
}

// numerator / denominator of a backward error: 0/0 is 0, anything that is not finite infinite.
double ratio(double numerator, double denominator) {
  if (numerator == 0) return 0;
  const double q = numerator / denominator;
  return std::isnan(q) ? std::numeric_limits<double>::infinity() : q;
}

void take_worst(std::span<const double> r, std::span<const double> bound, BackwardErrors& errors) {
  for (std::size_t i = 0; i < r.size(); ++i) {
    const double e = ratio(std::abs(r[i]), bound[i]);
    if (e > errors.componentwise) {
      errors.componentwise = e;
      errors.worst_row = static_cast<Index>(i);
    }
  }
}

}  // namespace

void residual(const MatrixView& a, std::span<const double> x, std::span<const double> b, std::span<double> r,
              Index columns, Transpose transpose, base::ThreadPool* pool) {
  const Extents s = check(a, x, b, columns, transpose);
  if (r.size() != b.size()) throw std::invalid_argument("residual: r and b differ in length");
  const auto sweep = has_fused() ? sweep_fused : sweep_portable;
  for (std::size_t c = 0; c < s.columns; ++c) {
    const double* xc = x.data() + c * s.cols;
    sum_columns<DoubleSum>(
        a, static_cast<Index>(s.rows), pool,
        [&](Index begin, Index end, DoubleSum* sums) { sweep(a, transpose, xc, begin, end, sums); },
        [&](Index i, DoubleSum sum) {
          const std::size_t at = c * s.rows + static_cast<std::size_t>(i);
          sum.add_pair(-b[at], 0);
          r[at] = -(sum.value + sum.correction);
        });
  }
}

BackwardErrors backward_errors(const MatrixView& a, std::span<const double> x, std::span<const double> b, Index columns,
                               Transpose transpose, base::ThreadPool* pool) {
  const Extents s = check(a, x, b, columns, transpose);
  std::vector<double> r(b.size()), bound(s.rows);
  residual(a, x, b, r, columns, transpose, pool);
  const double norm = transpose == Transpose::no ? norm_inf(a, pool) : norm_one(a, pool);
  BackwardErrors errors;
  for (std::size_t c = 0; c < s.columns; ++c) {
    const auto xc = x.subspan(c * s.cols, s.cols), bc = b.subspan(c * s.rows, s.rows);
    const auto rc = std::span<const double>(r).subspan(c * s.rows, s.rows);
    sum_columns<AbsoluteSum>(
        a, static_cast<Index>(s.rows), pool,
        [&](Index begin, Index end, AbsoluteSum* sums) { sweep_columns(a, transpose, xc.data(), begin, end, sums); },
        [&](Index i, const AbsoluteSum& sum) {
          bound[static_cast<std::size_t>(i)] = sum.value + std::abs(bc[static_cast<std::size_t>(i)]);
        });
    take_worst(rc, bound, errors);
    const double size = norm * magnitude(xc) + magnitude(bc);
    const double normwise = std::isfinite(size) ? ratio(magnitude(rc), size) : std::numeric_limits<double>::infinity();
    errors.normwise = std::max(errors.normwise, normwise);
  }
  if (std::isinf(errors.normwise)) errors.componentwise = errors.normwise;
  return errors;
}

}  // namespace espalier::matrix
