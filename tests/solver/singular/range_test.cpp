// Matrices whose entries span most of the range of numbers. Truths: a regular matrix stays regular when its rows and
// columns are multiplied by powers of two, its solution changes by these powers exactly, and so does the determinant.
#include <gtest/gtest.h>

#include <random>

#include "solver/solver_common.hpp"

namespace espalier {
namespace range_test {

using reference::Values;
using namespace test;

// b = A x in the order of the entries.
std::vector<double> product(const MatrixView& a, const std::vector<double>& x) {
  std::vector<double> b(x.size(), 0);
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const auto at = static_cast<std::size_t>(q), r = static_cast<std::size_t>(a.row_ind[at]);
      b[r] += a.values[at] * x[static_cast<std::size_t>(c)];
      if (a.storage != Storage::general && a.row_ind[at] != c) b[static_cast<std::size_t>(c)] += a.values[at] * x[r];
    }
  return b;
}

// The largest |b - A x|_i / (|A| |x| + |b|)_i, of which scaling by powers of two changes nothing.
double componentwise(const MatrixView& a, const std::vector<double>& b, const std::vector<double>& x) {
  std::vector<double> magnitude(x.size());
  SparseMatrix absolute{a.rows,
                        a.cols,
                        {a.col_ptr.begin(), a.col_ptr.end()},
                        {a.row_ind.begin(), a.row_ind.end()},
                        {a.values.begin(), a.values.end()},
                        a.storage};
  for (double& v : absolute.values) v = std::abs(v);
  for (std::size_t i = 0; i < x.size(); ++i) magnitude[i] = std::abs(x[i]);
  const std::vector<double> scale = product(absolute, magnitude);
  const std::vector<double> r = reference::residual(a, b.data(), x.data(), false);
  double most = 0;
  for (std::size_t i = 0; i < r.size(); ++i)
    if (r[i] != 0) most = std::max(most, std::abs(r[i]) / (scale[i] + std::abs(b[i])));
  return most;
}

struct Powers {
  std::vector<int> row, col;
};

// Exponents of rows and columns; no entry leaves 2^-1000 .. 2^1000, so that all of them keep their digits.
Powers random_powers(Index n, int most, bool symmetric, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const int span = symmetric || most > 450 ? std::min(most, 900) / 2 : most;
  std::uniform_int_distribution<int> draw(-span, span);
  Powers p;
  for (Index i = 0; i < n; ++i) p.row.push_back(draw(random));
  for (Index i = 0; i < n; ++i) p.col.push_back(symmetric ? p.row[static_cast<std::size_t>(i)] : draw(random));
  return p;
}

SparseMatrix scaled(SparseMatrix a, const Powers& p) {
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const auto at = static_cast<std::size_t>(q);
      a.values[at] =
          std::ldexp(a.values[at], p.row[static_cast<std::size_t>(a.row_ind[at])] + p.col[static_cast<std::size_t>(c)]);
    }
  return a;
}

void expect_regular(const SparseMatrix& a, const Powers& p, const Options& o) {
  const SparseMatrix wide = scaled(a, p);
  std::vector<double> x = reference::random_vector(a.rows, 5);
  std::vector<double> b = product(a, x);
  double log = reference::determinant(a).log;
  for (std::size_t i = 0; i < b.size(); ++i) {
    b[i] = std::ldexp(b[i], p.row[i]);
    log += (p.row[i] + p.col[i]) * std::log(2.0);
  }
  Solver s(o);
  const AnalysisResult analysis = s.analyze(wide);
  ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
  const FactorResult factor = s.factorize(wide);
  ASSERT_TRUE(factor.status.ok()) << factor.status.message;
  EXPECT_EQ(factor.determinant_sign, reference::determinant(a).sign);
  const double digits = o.precision == Precision::fp64 ? 1e-12 : 1e-4;
  EXPECT_NEAR(factor.determinant_log, log, digits * (std::abs(log) + a.rows));
  const SolveResult r = s.solve(b, x);
  // FP32 loses the small components of right-hand sides and residuals that span more than its own range; then it says
  // so.
  const bool double_precision = o.precision == Precision::fp64;
  EXPECT_TRUE(r.status.ok() || (!double_precision && r.status.code == StatusCode::accuracy_not_reached))
      << r.status.message;
  if (double_precision) {
    EXPECT_LE(componentwise(wide, b, x), 1e-14);
  }
}

TEST(Range, RowsAndColumnsByPowersOfTwo) {
  for (const int most : {100, 300, 500, 900})
    for (const Values values : {Values::positive, Values::indefinite, Values::general})
      for (const Precision precision : {Precision::fp64, Precision::mixed})
        for (const bool matching : {true, false})
          for (std::uint64_t seed = 1; seed <= 6; ++seed) {
            SCOPED_TRACE("2^" + std::to_string(most) + ", values " + std::to_string(static_cast<int>(values)) +
                         (precision == Precision::mixed ? ", mixed" : ", fp64") + (matching ? "" : ", no matching") +
                         ", seed " + std::to_string(seed));
            // Maxima alone do not find scalings of unsymmetric matrices, and not well enough for FP32 without a
            // diagonal.
            if (!matching &&
                (values == Values::general || (values == Values::indefinite && precision != Precision::fp64)))
              continue;
            const SparseMatrix a = reference::random_system(60, 5, values, seed);
            Options o = two_threads();
            o.precision = precision;
            o.matching = matching;
            expect_regular(a, random_powers(60, most, values != Values::general, seed), o);
            if (::testing::Test::HasFailure()) return;
          }
}

TEST(Range, SmallOnesOfTheIssue) {
  const SparseMatrix apart = diagonal({1e-140, 1e140});
  const SparseMatrix one = diagonal({1e300, 1, 2});
  const SparseMatrix full =
      reference::from_triples(3, {{0, 0, 4e300}, {1, 0, 1e300}, {1, 1, 3e300}, {2, 2, 2}}, Storage::symmetric_lower);
  const SparseMatrix general =
      reference::from_triples(3, {{0, 0, 1e300}, {0, 1, 1}, {1, 1, 1}, {2, 2, 2}}, Storage::general);
  for (const SparseMatrix& a : {apart, one, full, general})
    for (const Kind kind : {Kind::automatic, Kind::llt, Kind::ldlt, Kind::lu})
      for (const Precision precision : {Precision::fp64, Precision::fp32, Precision::mixed}) {
        if (a.storage == Storage::general && kind != Kind::automatic && kind != Kind::lu) continue;
        SCOPED_TRACE("kind " + std::to_string(static_cast<int>(kind)) + ", precision " +
                     std::to_string(static_cast<int>(precision)) + ", first " + std::to_string(a.values[0]));
        Options o = two_threads();
        o.kind = kind;
        o.precision = precision;
        const Powers none{std::vector<int>(static_cast<std::size_t>(a.rows), 0),
                          std::vector<int>(static_cast<std::size_t>(a.rows), 0)};
        expect_regular(a, none, o);
      }
}

// New values far from the analyzed ones: said, with what to do; after it all is well.
TEST(Range, NewValuesFarFromTheAnalyzedOnes) {
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    const SparseMatrix a = reference::random_system(40, 5, Values::positive, 3);
    SparseMatrix far = a;
    for (double& v : far.values) v *= 0x1p900;
    Options o = two_threads();
    o.kind = kind;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const Status status = s.factorize(far).status;
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    EXPECT_NE(status.message.find("call analyze()"), std::string::npos) << status.message;
    expect_solved(s, far);
  }
}

}  // namespace range_test
}  // namespace espalier
