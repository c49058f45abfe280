// Residuals in twice the precision, and backward errors. The truth is long double after summing duplicates, and cases
// whose residual is known exactly though double precision cannot see it.
#include "solve/residual.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

#include "reference/reference.hpp"

namespace espalier::solve {
namespace {

using reference::Values;
constexpr double kUnit = std::numeric_limits<double>::epsilon();

TEST(Residual, EqualsLongDoubleForEveryStorageAndTranspose) {
  base::ThreadPool pool(2);
  for (const Values values : {Values::positive, Values::indefinite, Values::general})
    for (const Storage storage :
         {Storage::general, Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both})
      for (const Index n : {1, 2, 50, 5000}) {
        if (values == Values::general && storage != Storage::general) continue;
        const SparseMatrix a = reference::stored_as(reference::random_system(n, 6, values, 1), storage, true);
        const ResidualOperator op(a, pool);
        const std::vector<double> x = reference::random_vector(n, 2), b = reference::random_vector(n, 3);
        for (const bool transpose : {false, true}) {
          std::vector<double> r(b.size());
          const BackwardError e = op.compute(b.data(), x.data(), r.data(), transpose);
          const std::vector<double> truth = reference::residual(a, b.data(), x.data(), transpose);
          // The truth itself carries the rounding of long double, some 30 times that of its largest terms.
          const double rounding = 30 * static_cast<double>(std::numeric_limits<long double>::epsilon());
          const double allowed = rounding * (op.norm(transpose) + 1);
          for (std::size_t k = 0; k < r.size(); ++k) ASSERT_NEAR(r[k], truth[k], allowed + kUnit * std::abs(truth[k]));
          EXPECT_NEAR(e.normwise, reference::backward_error(a, b, x, 1, transpose), 1e-12 + 0.7 * e.normwise);
          std::vector<double> y(b.size()), zero(b.size(), 0.0);
          op.multiply(x.data(), y.data(), transpose);
          const std::vector<double> minus = reference::residual(a, zero.data(), x.data(), transpose);
          for (std::size_t k = 0; k < y.size(); ++k) ASSERT_NEAR(y[k], -minus[k], 100 * kUnit * op.norm(transpose));
          const BackwardError again = op.compute(b.data(), x.data(), nullptr, transpose);
          EXPECT_EQ(again.componentwise, e.componentwise);
          EXPECT_EQ(again.normwise, e.normwise);
        }
      }
}

TEST(Residual, SeveralColumnsEqualLongDoubleAndKeepApart) {
  base::ThreadPool pool(2);
  const Index n = 3000, count = 19;  // two full passes and a rest
  for (const Values values : {Values::indefinite, Values::general})
    for (const bool transpose : {false, true}) {
      const SparseMatrix a = reference::random_system(n, 6, values, 21);
      const ResidualOperator op(a, pool);
      const std::vector<double> x = reference::random_vector(std::int64_t{n} * count, 22);
      std::vector<double> b = reference::random_vector(std::int64_t{n} * count, 23), r(x.size());
      b[5] = std::numeric_limits<double>::infinity();
      std::vector<ResidualColumn> columns;
      for (std::size_t k = 0; k < x.size(); k += n) columns.push_back({&b[k], &x[k], k == n ? nullptr : &r[k], {}});
      op.compute(columns, transpose);
      EXPECT_EQ(columns[0].error.normwise, std::numeric_limits<double>::infinity()) << "not finite: this column alone";
      const double rounding = 30 * static_cast<double>(std::numeric_limits<long double>::epsilon());
      for (std::size_t k = 1; k < columns.size(); ++k) {
        const ResidualColumn& c = columns[k];
        const std::vector<double> truth = reference::residual(a, c.b, c.x, transpose);
        for (std::size_t i = 0; k > 1 && i < truth.size(); ++i)
          ASSERT_NEAR(c.r[i], truth[i], rounding * (op.norm(transpose) + 1) + kUnit * std::abs(truth[i]));
        std::vector<double> r_alone(n);
        const BackwardError alone = op.compute(c.b, c.x, r_alone.data(), transpose);
        EXPECT_EQ(c.error.normwise, alone.normwise);
        EXPECT_EQ(c.error.componentwise, alone.componentwise);
        if (k == 1) continue;  // nobody wants its residual
        EXPECT_TRUE(std::equal(r_alone.begin(), r_alone.end(), c.r)) << "the bits that it has alone";
      }
    }
}

TEST(Residual, ProductsOfSeveralColumnsHaveTheBitsOfOne) {
  base::ThreadPool pool(2);
  const Index n = 2500, count = 11;  // a full pass and a rest
  for (const Storage storage : {Storage::general, Storage::symmetric_lower, Storage::symmetric_both})
    for (const bool transpose : {false, true}) {
      const Values values = storage == Storage::general ? Values::general : Values::indefinite;
      const SparseMatrix a = reference::stored_as(reference::random_system(n, 6, values, 31), storage, true);
      const ResidualOperator op(a, pool);
      const std::vector<double> x = reference::random_vector(std::int64_t{n} * count, 32);
      std::vector<double> y(x.size()), alone(x.size());
      op.multiply_columns(x.data(), y.data(), count, transpose);
      for (std::size_t k = 0; k < x.size(); k += n) op.multiply(&x[k], &alone[k], transpose);
      EXPECT_EQ(y, alone);
    }
}

TEST(Residual, SeesWhatDoublePrecisionCancels) {
  base::ThreadPool pool(1);
  // 1 - (1 + eps)(1 - eps) = eps^2
  const SparseMatrix one = reference::from_triples(1, {{0, 0, 1 + kUnit}}, Storage::general);
  const double x = 1 - kUnit, b = 1;
  double r = 0;
  (void)ResidualOperator(one, pool).compute(&b, &x, &r, false);
  EXPECT_EQ(r, kUnit * kUnit);
  // 2^60 - 2^60 + 1 in any order of the row
  for (const bool transpose : {false, true}) {
    const SparseMatrix row =
        transpose ? reference::from_triples(3, {{0, 0, 0x1p60}, {1, 0, -0x1p60}, {2, 0, 1}}, Storage::general)
                  : reference::from_triples(3, {{0, 0, 0x1p60}, {0, 1, 1}, {0, 2, -0x1p60}}, Storage::general);
    const double ones[] = {1, 1, 1}, zero[] = {0, 0, 0};
    double out[3];
    (void)ResidualOperator(row, pool).compute(zero, ones, out, transpose);
    EXPECT_EQ(out[0], -1);
  }
}

// b is A x, rounded: what is left is the rounding of each entry, below the last digit of every term.
TEST(Residual, OfARoundedProductIsItsRounding) {
  base::ThreadPool pool(2);
  const Index n = 3000, count = 3;
  const double rounding = 60 * static_cast<double>(std::numeric_limits<long double>::epsilon());
  for (const Storage storage : {Storage::general, Storage::symmetric_lower, Storage::symmetric_both}) {
    const SparseMatrix a = reference::stored_as(reference::random_system(n, 6, Values::indefinite, 1), storage, true);
    const ResidualOperator op(a, pool);
    const std::vector<double> x = reference::random_vector(std::int64_t{n} * count, 2);
    std::vector<double> b(x.size()), r(x.size());
    for (std::size_t k = 0; k < x.size(); k += n) op.multiply(&x[k], &b[k], false);
    std::vector<ResidualColumn> columns;
    for (std::size_t k = 0; k < x.size(); k += n) columns.push_back({&b[k], &x[k], &r[k], {}});
    op.compute(columns, false);
    for (const ResidualColumn& c : columns) {
      std::vector<double> alone(n);
      (void)op.compute(c.b, c.x, alone.data(), false);
      const std::vector<double> truth = reference::residual(a, c.b, c.x, false);
      double most = 0;
      for (std::size_t i = 0; i < truth.size(); ++i) {
        most = std::max(most, std::abs(truth[i]));
        ASSERT_NEAR(c.r[i], truth[i], rounding * (op.norm(false) + 1) + kUnit * std::abs(truth[i]));
        ASSERT_NEAR(alone[i], truth[i], rounding * (op.norm(false) + 1) + kUnit * std::abs(truth[i]));
      }
      EXPECT_GT(most, 4 * rounding * (op.norm(false) + 1)) << "there is something to see";
    }
  }
}

// Truth: the formulas, term by term.
TEST(Residual, BackwardErrorsOfComplexSystems) {
  using Value = std::complex<double>;
  base::ThreadPool pool(1);
  const Index n = 4;
  SparseMatrix a{n, n, {0}, {}, {}, Storage::general};
  const std::vector<double> parts = reference::random_vector(2 * n * n + 4 * n, 5);
  for (Index c = 0; c < n; ++c) {
    for (Index r = 0; r < n; ++r) a.row_ind.push_back(r);
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  a.values.assign(parts.begin(), parts.begin() + 2 * n * n);
  MatrixView view = a;
  const auto rows = ResidualOperator::rows_of(view, pool);
  const ResidualOperator op(view, rows, pool, base::Numbers::complex);
  const double *b = &parts[2 * n * n], *x = b + 2 * n;
  const auto value = [](const double* from, Index k) { return Value(from[2 * k], from[2 * k + 1]); };
  double componentwise = 0, residual = 0, largest_x = 0, largest_b = 0, norm = 0;
  for (Index r = 0; r < n; ++r) {
    Value left = value(b, r);
    double scale = std::abs(left), sum = 0;
    for (Index c = 0; c < n; ++c) {
      const Value entry = value(a.values.data(), c * n + r);
      left -= entry * value(x, c);
      scale += std::abs(entry) * std::abs(value(x, c));
      sum += std::abs(entry);
    }
    componentwise = std::max(componentwise, std::abs(left) / scale);
    residual = std::max(residual, std::abs(left));
    largest_x = std::max(largest_x, std::abs(value(x, r)));
    largest_b = std::max(largest_b, std::abs(value(b, r)));
    norm = std::max(norm, sum);
  }
  const BackwardError e = op.compute(b, x, nullptr, false);
  EXPECT_NEAR(e.componentwise, componentwise, 1e-14);
  EXPECT_NEAR(e.normwise, residual / (norm * largest_x + largest_b), 1e-14);
}

TEST(Residual, BackwardErrorsOfAHandMadeCase) {
  base::ThreadPool pool(1);
  // A = diag(1, 100), b = (1, 1), x = (1 + 1e-3, 0.01): r = (-1e-3, 0)
  const SparseMatrix a = reference::from_triples(2, {{0, 0, 1}, {1, 1, 100}}, Storage::symmetric_lower);
  const double b[] = {1, 1}, x[] = {1.001, 0.01};
  const BackwardError e = ResidualOperator(a, pool).compute(b, x, nullptr, false);
  EXPECT_NEAR(e.normwise, 1e-3 / (100 * 1.001 + 1), 1e-15);
  EXPECT_NEAR(e.componentwise, 1e-3 / 2.001, 1e-15);
}

TEST(Residual, NotFiniteVectorsAreInfinitelyWrongAndZerosAreRight) {
  base::ThreadPool pool(2);
  const SparseMatrix a = reference::random_system(4000, 4, Values::positive, 4);
  const ResidualOperator op(a, pool);
  std::vector<double> x(4000, 0.0), b(4000, 0.0);
  EXPECT_EQ(op.compute(b.data(), x.data(), nullptr, false).componentwise, 0);
  EXPECT_EQ(op.compute(b.data(), x.data(), nullptr, false).normwise, 0);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    x[3999] = bad;
    const BackwardError e = op.compute(b.data(), x.data(), nullptr, false);
    EXPECT_EQ(e.normwise, std::numeric_limits<double>::infinity());
    EXPECT_EQ(e.componentwise, std::numeric_limits<double>::infinity());
  }
}

TEST(Residual, ThreadsDoNotChangeBitsAndNewValuesAreUsed) {
  const SparseMatrix a = reference::random_system(9000, 5, Values::general, 5);
  std::vector<double> first, x = reference::random_vector(9000, 6), b = reference::random_vector(9000, 7);
  for (const int threads : {1, 2, 4}) {
    base::ThreadPool pool(threads);
    ResidualOperator op(a, pool);
    std::vector<double> r(9000);
    (void)op.compute(b.data(), x.data(), r.data(), true);
    if (first.empty()) first = r;
    EXPECT_EQ(r, first);
    const double norm = op.norm(false);
    std::vector<double> twice(a.values);
    for (double& v : twice) v *= 2;
    op.set_values(twice);
    EXPECT_EQ(op.norm(false), 2 * norm);
    EXPECT_GT(op.bytes(), 0);
  }
}

// Truth: the rows alone.
TEST(Residual, PartsHaveTheNormOfTheirRows) {
  base::ThreadPool pool(2);
  const SparseMatrix a = reference::random_system(900, 5, Values::general, 5);
  const ResidualOperator op(a, pool);
  std::vector<double> sums(900, 0.0);
  for (Offset q = 0; q < a.nonzeros(); ++q)
    sums[static_cast<std::size_t>(a.row_ind[static_cast<std::size_t>(q)])] +=
        std::abs(a.values[static_cast<std::size_t>(q)]);
  EXPECT_NEAR(op.norm(false), *std::max_element(sums.begin(), sums.end()), 1e-13);
  for (const Index first : {0, 300, 600})
    EXPECT_NEAR(op.of_rows(first, first + 300).norm(false),
                *std::max_element(sums.begin() + first, sums.begin() + first + 300), 1e-13);
}

// Truth: every value of vectors that several threads share, and one that is not finite wherever it stands.
TEST(Residual, CopiesAndAddsLongVectors) {
  const Index n = 50000;
  base::ThreadPool pool(2);
  const SparseMatrix a = reference::random_system(n, 1, Values::positive, 5);
  const ResidualOperator op(a, pool);
  const std::vector<double> from = reference::random_vector(n, 6), more = reference::random_vector(n, 7);
  std::vector<double> to(from.size());
  op.copy(from.data(), to.data());
  EXPECT_EQ(to, from);
  EXPECT_TRUE(op.add(more.data(), to.data()));
  for (std::size_t k = 0; k < to.size(); ++k) ASSERT_EQ(to[k], from[k] + more[k]);
  for (const std::size_t bad : {std::size_t{0}, std::size_t{20000}, to.size() - 1}) {
    std::vector<double> broken = from;
    broken[bad] = std::numeric_limits<double>::infinity();
    EXPECT_FALSE(op.add(more.data(), broken.data())) << bad;
  }
}

}  // namespace
}  // namespace espalier::solve
