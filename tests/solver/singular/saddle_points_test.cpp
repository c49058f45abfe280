// Regularised saddle points: a corner that is far smaller than what stands beside it, down to 1e-300. Truth: the
// residual in long double. Whatever the corner is, units, numbering and numbers are, a solution is good to rounding.
#include "reference/saddle_points.hpp"

#include <complex>
#include <random>

#include "solver/solver_common.hpp"

namespace espalier {
namespace saddle_points_test {

using reference::Corner;
using reference::SaddleShape;
using Number = std::complex<double>;

double error_of(const SparseMatrix& a, const std::vector<double>& b, const std::vector<double>& x) {
  return reference::backward_error(a, b, x);
}

double error_of(const ComplexSparseMatrix& a, const std::vector<Number>& b, const std::vector<Number>& x) {
  using Long = std::complex<long double>;
  std::vector<Long> r(b.begin(), b.end());
  std::vector<long double> sums(b.size(), 0);
  const auto take = [&](Index i, Index j, Number v) {
    r[static_cast<std::size_t>(i)] -= Long(v) * Long(x[static_cast<std::size_t>(j)]);
    sums[static_cast<std::size_t>(i)] += std::abs(Long(v));
  };
  for (Index j = 0; j < a.cols; ++j)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(j)]; q < a.col_ptr[static_cast<std::size_t>(j) + 1]; ++q) {
      const Index i = a.row_ind[static_cast<std::size_t>(q)];
      const Number v = a.values[static_cast<std::size_t>(q)];
      take(i, j, v);
      if (a.storage != Storage::general && i != j) take(j, i, a.storage == Storage::hermitian_lower ? std::conj(v) : v);
    }
  long double most_r = 0, most_x = 0, most_b = 0, norm = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    most_r = std::max(most_r, std::abs(r[i]));
    most_x = std::max(most_x, std::abs(Long(x[i])));
    most_b = std::max(most_b, std::abs(Long(b[i])));
    norm = std::max(norm, sums[i]);
  }
  if (!std::isfinite(static_cast<double>(most_x))) return std::numeric_limits<double>::infinity();
  return most_r > 0 ? static_cast<double>(most_r / (norm * most_x + most_b)) : 0;
}

template <class Matrix, class Value>
void expect_good(const Matrix& a, const std::vector<Value>& b, Kind kind) {
  Options o;
  o.threads = 1;
  o.kind = kind;
  SolverOf<Value> s(o);
  const auto analysis = s.analyze(a);
  ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
  const auto factor = s.factorize(a);
  ASSERT_TRUE(factor.status.ok()) << factor.status.message;
  EXPECT_EQ(factor.rank, a.rows);
  std::vector<Value> x(b.size());
  const SolveResult r = s.solve(b, x);
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_LE(error_of(a, b, x), 1e-15);
}

std::vector<double> product_with_ones(const SparseMatrix& a) {
  const std::vector<double> one(static_cast<std::size_t>(a.rows), 1.0), zero(one.size(), 0.0);
  std::vector<double> b = reference::residual(a, zero.data(), one.data(), false);
  for (double& v : b) v = -v;
  return b;
}

// Both kinds, rows in another order, and in complex numbers, symmetric and Hermitian; b of ones, and of a solution.
void expect_good(const SparseMatrix& a, std::uint64_t seed) {
  const SparseMatrix shuffled = reference::shuffled_rows(a, seed);
  const std::vector<double> one(static_cast<std::size_t>(a.rows), 1.0);
  for (const std::vector<double>& b : {one, product_with_ones(a)}) {
    expect_good(a, b, Kind::ldlt);
    expect_good(a, b, Kind::lu);
    expect_good(shuffled, b, Kind::lu);
    const std::vector<Number> complex_b(b.begin(), b.end());
    for (const bool hermitian : {false, true})
      for (const Kind kind : {Kind::ldlt, Kind::lu})
        expect_good(reference::turned(a, hermitian, seed), complex_b, kind);
    if (::testing::Test::HasFailure()) return;
  }
}

TEST(SaddlePoints, TinyDiagonalOfTwoUnknowns) {
  for (const double d : {1e-8, 1e-50, 1e-300}) {
    const SparseMatrix a = reference::from_triples(2, {{1, 0, 1.0}, {1, 1, d}}, Storage::symmetric_lower);
    SCOPED_TRACE(d);
    for (const Kind kind : {Kind::ldlt, Kind::lu}) expect_good(a, std::vector<double>{1, 1}, kind);
  }
}

TEST(SaddlePoints, CornersOfThreeHundredDecades) {
  std::mt19937 random(40);
  std::uniform_real_distribution<double> unit(0, 1);
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    const auto half = static_cast<Index>(1 + std::exp(unit(random) * std::log(seed % 15 == 0 ? 500.0 : 40.0)));
    const int exponent = std::array<int, 3>{0, 332, -332}[seed % 3];  // about 1e+-100
    const auto size = [&] { return std::pow(10.0, -unit(random) * (exponent == 0 ? 300 : 150)); };
    SaddleShape shape{half, half, Corner::zero, Corner::identity, size(), size(), seed};
    if (seed % 5 == 1) std::swap(shape.upper, shape.lower);
    if (seed % 5 == 2) shape.upper = Corner::identity;
    if (seed % 5 == 3) shape.lower = Corner::wandering, shape.lower_size = std::sqrt(shape.lower_size);
    if (seed % 5 == 4) shape.upper = Corner::chain, shape.upper_size = 1, shape.bottom = (half + 1) / 2;
    SCOPED_TRACE(name_of(shape) + ", 2^" + std::to_string(exponent));
    expect_good(reference::in_units(saddle_point(shape), exponent), seed);
    if (::testing::Test::HasFailure()) return;
  }
}

// B is not square: every scaling to a matching then drives the factors apart, and a first solution may be noise alone.
TEST(SaddlePoints, RectangularCouplings) {
  for (const double size : {1e-6, 1e-10, 1e-14, 1e-20, 1e-30, 1e-40})
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      const auto many = static_cast<Index>(2 + seed % 7), few = static_cast<Index>(1 + seed % 3);
      for (const SaddleShape& shape : {SaddleShape{few, few + many, Corner::zero, Corner::identity, 0, size, seed},
                                       SaddleShape{few + many, few, Corner::identity, Corner::zero, size, 0, seed}}) {
        SCOPED_TRACE(name_of(shape));
        const SparseMatrix a = saddle_point(shape);
        for (const Kind kind : {Kind::ldlt, Kind::lu}) expect_good(a, product_with_ones(a), kind);
        if (::testing::Test::HasFailure()) return;
      }
    }
}

}  // namespace saddle_points_test
}  // namespace espalier
