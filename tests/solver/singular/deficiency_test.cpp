// Singular is singular, regular is regular. Truth: ranks known by construction (tests/verdict/cases.hpp), the dense
// singular values of a matrix, A v in long double.
#include <algorithm>
#include <cmath>

#include "solver/solver_common.hpp"
#include "verdict/cases.hpp"

namespace espalier::test {
namespace deficiency_test {

using reference::Triple;

Options reporting(Kind kind = Kind::automatic, Precision precision = Precision::fp64) {
  Options o = two_threads();
  o.singular = SingularMatrix::report;
  o.kind = kind;
  o.precision = precision;
  return o;
}

FactorResult factor(const SparseMatrix& a, const Options& o) {
  Solver s(o);
  const AnalysisResult analysis = s.analyze(a);
  EXPECT_TRUE(analysis.status.ok()) << analysis.status.message;
  if (!analysis.status.ok()) return {};
  return s.factorize(a);
}

// |A v|_inf over |A|_inf |v|_inf for every null vector, by an independent residual; likewise those of A^T.
void expect_null_vectors(const SparseMatrix& a, const FactorResult& f) {
  const auto n = static_cast<std::size_t>(a.rows);
  const Index zeros = a.rows - f.rank;
  ASSERT_EQ(f.null_vectors.size(), n * static_cast<std::size_t>(zeros));
  EXPECT_EQ(static_cast<Index>(f.dependent_rows.size()), zeros);
  EXPECT_TRUE(std::is_sorted(f.dependent_rows.begin(), f.dependent_rows.end()));
  const std::vector<double> zero(n, 0.0);
  const auto check_vectors = [&](const std::vector<double>& all, bool transpose) {
    for (std::size_t at = 0; at < all.size(); at += n) {
      const std::vector<double> v(all.begin() + static_cast<std::ptrdiff_t>(at),
                                  all.begin() + static_cast<std::ptrdiff_t>(at + n));
      EXPECT_LE(reference::backward_error(a, zero, v, 1, transpose), 16 * kEps) << (transpose ? "left" : "right");
    }
  };
  check_vectors(f.null_vectors, false);
  if (a.storage == Storage::general) {
    EXPECT_EQ(f.left_null_vectors.size(), f.null_vectors.size());
  }
  check_vectors(f.left_null_vectors, true);
}

TEST(Deficiency, OfRandomStructuresInManyDisguises) {
  for (Index structure = 0; structure < verdict::structures(); ++structure)
    for (const std::uint64_t seed : {3, 4})
      for (const Index n : {12, 70, 190}) {
        const verdict::Case c = verdict::make_case(structure, n, seed);
        SCOPED_TRACE(testing::Message() << c.name << " seed " << seed << " n " << c.a.rows);
        for (const SparseMatrix& a : {c.a, verdict::disguised(c.a, 100, seed)})
          for (const Kind kind : {Kind::automatic, Kind::lu}) {
            Solver s(reporting(kind));
            if (!s.analyze(a).status.ok()) {
              EXPECT_GT(c.zeros, 0);
              continue;
            }
            const FactorResult f = s.factorize(a);
            ASSERT_TRUE(f.status.ok()) << f.status.message;
            EXPECT_EQ(a.rows - f.rank, c.zeros);
            if (f.inertia.zero >= 0 && c.negative >= 0) {
              EXPECT_EQ(f.inertia.negative, c.negative);
            }
            if (c.zeros > 0 && &a == &c.a) expect_null_vectors(a, f);
          }
      }
}

// Two zeros, of which the factor shows one clearly and the other through its own errors only; and one zero in a matrix
// so small that the block of directions fills the space. Found by tests/verdict/campaign.cpp.
TEST(Deficiency, AZeroBehindTheErrorsOfTheFactor) {
  constexpr Index kGraph = 0, kRows = 6;
  const struct {
    Index structure, n;
    std::uint64_t seed;
    int range;
  } cases[] = {{kRows, 125, 5900236, 0}, {kRows, 128, 1900246, 0}, {kRows, 62, 70000111, 0}, {kRows, 156, 70002501, 0},
               {kRows, 35, 70004272, 0}, {kRows, 46, 70004883, 0}, {kRows, 85, 2900285, 30}, {kGraph, 6, 2900233, 30}};
  for (const auto& [structure, n, seed, range] : cases) {
    const verdict::Case c = verdict::make_case(structure, n, seed);
    SCOPED_TRACE(testing::Message() << c.name << " seed " << seed << " n " << c.a.rows);
    const SparseMatrix a = range > 0 ? verdict::disguised(c.a, range, seed) : c.a;
    Options o = reporting();
    o.threads = 1;
    const FactorResult f = factor(a, o);
    EXPECT_EQ(a.rows - f.rank, c.zeros);
    if (range == 0) expect_null_vectors(a, f);
  }
}

// Several zeros in one part of the factor, which shows all of them on one side and fewer on the other. Found by
// tests/verdict/campaign.cpp.
TEST(Deficiency, BothSidesHaveAsManyNullVectors) {
  constexpr Index kCombined = 16;
  const struct {
    Index n;
    std::uint64_t seed;
    int range;  // of the units, as powers of two
  } cases[] = {{74, 99212, 0}, {78, 99432, 0}, {30, 100073, 0}, {49, 100496, 0}, {18, 123459284, 200}};
  for (const auto& [n, seed, range] : cases)
    for (const int exponent : {0, -150}) {
      const verdict::Case c = verdict::make_case(kCombined, n, seed);
      SCOPED_TRACE(testing::Message() << "seed " << seed << " n " << n << " 2^" << exponent);
      const SparseMatrix a = verdict::in_units(range > 0 ? verdict::disguised(c.a, range, seed + 1) : c.a, exponent);
      const FactorResult f = factor(a, reporting());
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_EQ(a.rows - f.rank, c.zeros);
      if (range == 0) expect_null_vectors(a, f);
    }
}

// Two vanishing pivots, one after the other, make inverses of tiles with numbers of 1e30: what the factor solves then
// is rounding error, and the second zero hides in it. Found by tests/verdict/campaign.cpp.
TEST(Deficiency, ZerosThatTheFactorDrownsInItsErrors) {
  struct {
    Index n;
    std::uint64_t seed;
    bool disguised;
  } const drowned[] = {{15, 500984, false}, {69, 501913, true}, {77, 501098, true}};
  for (const auto& d : drowned) {
    const verdict::Case c = verdict::make_case(6, d.n, d.seed);
    SCOPED_TRACE(testing::Message() << c.name << " seed " << d.seed << " n " << c.a.rows);
    const SparseMatrix a = d.disguised ? verdict::disguised(c.a, 200, d.seed + 1) : c.a;
    const FactorResult f = factor(a, reporting());
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(a.rows - f.rank, c.zeros);
    expect_null_vectors(a, f);
  }
}

// A factor of L U whose errors are three times the bound of a zero solves like that of a regular matrix; that its
// solutions are null vectors of the matrix is another matter. Found by tests/verdict/campaign.cpp.
TEST(Deficiency, ErrorsOfAFactorProveNothing) {
  struct {
    Index n;
    std::uint64_t seed;
  } const beams[] = {{296, 1900000014}, {283, 1900000415}, {264, 1900000437}};
  for (const auto& beam : beams) {
    const verdict::Case c = verdict::make_case(15, beam.n, beam.seed);
    SCOPED_TRACE(testing::Message() << c.name << " seed " << beam.seed);
    const FactorResult f = factor(c.a, reporting(Kind::lu));
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(c.a.rows - f.rank, 2);
    expect_null_vectors(c.a, f);
  }
}

// What FP32 has looked at is looked at again with the eyes of FP64.
TEST(Deficiency, MixedPrecisionOverlooksNoZeroThatFp64Sees) {
  const verdict::Case c = verdict::make_case(7, 60, 500785);
  ASSERT_EQ(c.zeros, 1);
  Options o = two_threads();
  o.precision = Precision::mixed;
  Solver s(o);
  ASSERT_TRUE(s.analyze(c.a).status.ok());
  const FactorResult f = s.factorize(c.a);
  if (f.status.code == StatusCode::singular) return;
  const std::vector<double> b = reference::random_vector(c.a.rows, 7);
  std::vector<double> x(b.size());
  EXPECT_EQ(s.solve(b, x).status.code, StatusCode::singular);
}

TEST(Deficiency, FreeGridsOfManySizes) {
  for (const Index side : {20, 45, 110}) {
    const verdict::Case c = verdict::make_case(2, side * side, 1);
    for (const Kind kind : {Kind::automatic, Kind::ldlt, Kind::lu})
      for (const Precision precision : {Precision::fp64, Precision::mixed}) {
        if (side > 45 && kind != Kind::automatic) continue;
        const FactorResult f = factor(c.a, reporting(kind, precision));
        ASSERT_TRUE(f.status.ok()) << f.status.message;
        ASSERT_EQ(f.rank, c.a.rows - 1) << side;
        expect_null_vectors(c.a, f);
        for (const double v : f.null_vectors) EXPECT_NEAR(std::abs(v), 1, 1e-10) << "the null vector is 1";
      }
    Solver s(two_threads());  // an error unless a report is asked for
    ASSERT_TRUE(s.analyze(c.a).status.ok());
    const FactorResult f = s.factorize(c.a);
    EXPECT_EQ(f.status.code, StatusCode::singular);
    EXPECT_GE(f.status.row, 0);
    EXPECT_EQ(s.state(), Solver::State::analyzed);
  }
}

// The free grid with 8 d on its diagonal has |A| = 8 and the smallest eigenvalue 8 d.
SparseMatrix nearly_free_grid(Index side, double d) {
  std::vector<Triple> entries;
  for (Index v = 0; v < side * side; ++v) {
    const Index i = v % side, j = v / side;
    entries.push_back({v, v, (i > 0) + (i + 1 < side) + (j > 0) + (j + 1 < side) + 8 * d});
    if (i + 1 < side) entries.push_back({v + 1, v, -1});
    if (j + 1 < side) entries.push_back({v + side, v, -1});
  }
  return reference::from_triples(side * side, entries, Storage::symmetric_lower);
}

// From 1e-12 down to 3e-17 the verdict turns once, at 16 eps.
TEST(Deficiency, TheVerdictTurnsOnceAtItsBound) {
  for (const Index side : {8, 30})
    for (const Kind kind : {Kind::automatic, Kind::ldlt, Kind::lu}) {
      SCOPED_TRACE(testing::Message() << "side " << side << " kind " << static_cast<int>(kind));
      for (double d = 1e-12; d > 3e-17; d /= 1.25) {
        if (std::abs(d / (16 * kEps) - 1) < 0.2) continue;
        const SparseMatrix a = nearly_free_grid(side, d);
        const FactorResult f = factor(a, reporting(kind));
        EXPECT_EQ(a.rows - f.rank, d > 16 * kEps ? 0 : 1) << d;
      }
    }
}

// A plate of 1200 x 1200 elements, 8.6 million unknowns, has 13 eps, and is none of those.
TEST(Deficiency, LargePositiveDefiniteMatricesMayComeNearer) {
  const struct {
    Index side;
    double d;
    Index zeros;
  } cases[] = {{320, 8, 0}, {320, 1, 1}, {300, 8, 1}};
  for (const auto& [side, d, zeros] : cases) {
    const SparseMatrix a = nearly_free_grid(side, d * kEps);
    const FactorResult f = factor(a, reporting());
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(a.rows - f.rank, zeros) << side << ", " << d << " eps";
  }
}

TEST(Deficiency, ABorderThatHoldsTheFreeGridMakesItRegular) {
  const verdict::Case free = verdict::make_case(2, 400, 1);
  for (const Kind kind : {Kind::automatic, Kind::lu}) {
    const FactorResult f = factor(verdict::bordered(free.a, 7), reporting(kind));
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(f.rank, free.a.rows + 1);
  }
}

// Small matrices by their singular values; the equilibrated Hilbert matrix has a condition of 1e12 at n = 10.
TEST(Deficiency, IllConditionedIsNotSingular) {
  for (const Index n : {4, 7, 9}) {
    std::vector<Triple> t;
    for (Index c = 0; c < n; ++c)
      for (Index r = c; r < n; ++r) t.push_back({r, c, 1.0 / (r + c + 1)});
    const SparseMatrix a = reference::from_triples(n, t, Storage::symmetric_lower);
    for (const Kind kind : {Kind::automatic, Kind::ldlt, Kind::lu}) EXPECT_EQ(factor(a, reporting(kind)).rank, n);
  }
  for (const double range : {10.0, 140.0}) {  // graded over 2 * range decades
    std::vector<double> d;
    for (int k = 0; k <= 60; ++k) d.push_back(std::pow(10.0, range * (k - 30) / 30) * (k % 3 == 0 ? -1 : 1));
    for (const Kind kind : {Kind::automatic, Kind::lu})
      EXPECT_EQ(factor(diagonal(d), reporting(kind)).rank, 61) << range;
  }
}

TEST(Deficiency, AReportKeepsAFactorThatSolvesConsistentSystems) {
  for (const Index structure : {0, 2, 4, 5}) {
    const verdict::Case c = verdict::make_case(structure, 150, 9);
    const auto n = static_cast<std::size_t>(c.a.rows);
    Solver s(reporting());
    ASSERT_TRUE(s.analyze(c.a).status.ok());
    ASSERT_TRUE(s.factorize(c.a).status.ok());
    ASSERT_EQ(s.state(), Solver::State::factorized);
    const std::vector<double> zero(n, 0.0), ones = reference::random_vector(c.a.rows, 3);
    std::vector<double> b = reference::residual(c.a, zero.data(), ones.data(), false), x(n);
    EXPECT_TRUE(s.solve(b, x).status.ok()) << c.name;
    EXPECT_LE(reference::backward_error(c.a, b, x), 1e-10) << c.name;
  }
}

TEST(Deficiency, TheCallersBoundIsAVerdictByItself) {
  const verdict::Case c = verdict::make_case(2, 400, 1);
  Options o = reporting(Kind::ldlt);
  o.zero_pivot = 1e-30;  // no pivot is as small: regular, says the caller
  EXPECT_EQ(factor(c.a, o).rank, c.a.rows);
  o.zero_pivot = 1e-8;
  EXPECT_EQ(factor(c.a, o).rank, c.a.rows - 1);
}

// ---- optimisers as callers ------------------------------------------------------------------------------------------

TEST(Optimisers, AnAnalysisTakesZerosForEntries) {
  const SparseMatrix a = reference::saddle_point(60, 20, 5);
  SparseMatrix zeros = a;
  std::fill(zeros.values.begin(), zeros.values.end(), 0.0);
  for (const bool looks : {true, false})
    for (const Kind kind : {Kind::ldlt, Kind::lu}) {
      Options o = two_threads();
      o.kind = kind;
      o.analyze_values = looks;
      Solver s(o);
      const AnalysisResult analysis = s.analyze(zeros);
      ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
      ASSERT_TRUE(s.refactorize(a.values).status.ok());
      expect_small_error(s, a);
    }
}

// A saddle point whose rows wander over 2 * 20 decades between factorizations; its inertia stays.
TEST(Optimisers, RescaledFactorizationsFollowTheValues) {
  const SparseMatrix a = reference::saddle_point(80, 30, 6);
  for (const auto& [kind, rescale] : {std::pair(Kind::ldlt, Rescale::on), std::pair(Kind::lu, Rescale::on),
                                      std::pair(Kind::ldlt, Rescale::equilibration)}) {
    Options o = two_threads();
    o.kind = kind;
    o.rescale = rescale;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const FactorResult first = s.factorize(a);
    ASSERT_TRUE(first.status.ok());
    for (const int decades : {3, 10, 20}) {
      SparseMatrix b = a;
      double log = 0;
      const auto scale = [&](Index k) { return std::ldexp(1.0, (k * 7 % 13 - 6) * decades / 2); };
      for (Index c = 0; c < b.cols; ++c) {
        log += 2 * std::log(scale(c));
        for (Offset q = b.col_ptr[static_cast<std::size_t>(c)]; q < b.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
          b.values[static_cast<std::size_t>(q)] *= scale(c) * scale(b.row_ind[static_cast<std::size_t>(q)]);
      }
      const FactorResult f = s.refactorize(b.values);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_EQ(f.rank, a.rows);
      EXPECT_EQ(f.inertia.negative, first.inertia.negative);
      EXPECT_NEAR(f.determinant_log, first.determinant_log + log, 1e-9 * std::abs(log));
      expect_small_error(s, b);
    }
  }
}

}  // namespace deficiency_test
}  // namespace espalier::test
