// What the solver reports beside the solution: inertia, determinant, condition, singularity, moved pivots and
// memory. The truth is dense (Eigen) or built into the matrix.
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "espalier/espalier.hpp"
#include "matrix/generators/random.hpp"
#include "matrix/transform.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace results_test {

using reference::Triple;
using reference::Values;
using namespace test;

// ---- inertia --------------------------------------------------------------------------------------------------------

void expect_inertia(const SparseMatrix& a, Options o) {
  const reference::Signs truth = reference::signs(a, 1e-13);
  ASSERT_EQ(truth.zero, 0) << "the test wants a regular matrix";
  Solver s(std::move(o));
  ASSERT_TRUE(s.analyze(a).status.ok());
  const FactorResult f = s.factorize(a);
  ASSERT_TRUE(f.status.ok()) << f.status.message;
  EXPECT_EQ(f.inertia.positive, truth.positive);
  EXPECT_EQ(f.inertia.negative, truth.negative);
  EXPECT_EQ(f.inertia.zero, 0);
  expect_small_error(s, a);
}

TEST(Inertia, EqualsTheSignsOfTheEigenvalues) {
  for (const bool matching : {true, false})
    for (std::uint64_t seed = 0; seed < 8; ++seed)
      for (const Index n : {1, 2, 5, 40, 150}) {
        SCOPED_TRACE(testing::Message() << "matching " << matching << " seed " << seed << " n " << n);
        Options o = two_threads();
        o.kind = Kind::ldlt;
        o.matching = matching;
        o.max_block_size = seed % 2 == 0 ? 0 : 16;
        expect_inertia(reference::random_system(n, 5, Values::indefinite, seed), o);
        if (n >= 40) expect_inertia(reference::saddle_point(n, n / 4, seed), o);
      }
}

TEST(Inertia, OfKktChainsAndLargerSystems) {
  for (const bool matching : {true, false}) {
    Options o = two_threads();
    o.matching = matching;
    SCOPED_TRACE(testing::Message() << "matching " << matching);
    expect_inertia(generated({"kkt", "3", "2", "2", "2"}), o);
    expect_inertia(generated({"kkt", "4", "4", "2", "2"}), o);
    expect_inertia(generated({"kkt-scaled", "2", "2", "2", "2"}), [&] {
      Options scaled = o;
      scaled.matching = true;  // twelve decades of bad scaling are what matching is for
      return scaled;
    }());
    expect_inertia(reference::saddle_point(500, 200, 3), o);
  }
}

TEST(Inertia, OfAWholeFrontAndOfTiledFronts) {
  // A dense matrix is one front: whole up to 128 rows, tiles of 16 and default width above.
  for (const Index n : {60, 128, 129, 200})
    for (const Index width : {0, 16}) {
      std::vector<Triple> t;
      for (Index c = 0; c < n; ++c)
        for (Index r = c; r < n; ++r)
          t.push_back({r, c, r == c ? 0.0 : 2 * matrix::random_unit(5, static_cast<std::uint64_t>(r * n + c)) - 1});
      Options o = two_threads();
      o.kind = Kind::ldlt;
      o.max_block_size = width;
      expect_inertia(reference::from_triples(n, t, Storage::symmetric_lower), o);
    }
}

// ---- determinant and condition --------------------------------------------------------------------------------------

TEST(Determinant, SignAndLogarithmEqualTheDenseOnes) {
  for (const Values values : {Values::positive, Values::indefinite, Values::general})
    for (const Kind kind : {Kind::automatic, Kind::lu})
      for (const bool matching : {true, false})
        for (std::uint64_t seed = 0; seed < 4; ++seed)
          for (const Index n : {1, 2, 9, 90}) {
            const SparseMatrix a = reference::random_system(n, 5, values, seed);
            const reference::Determinant truth = reference::determinant(a);
            Options o = two_threads();
            o.kind = kind;
            o.matching = matching;
            Solver s(o);
            ASSERT_TRUE(s.analyze(a).status.ok());
            const FactorResult f = s.factorize(a);
            ASSERT_TRUE(f.status.ok()) << f.status.message;
            EXPECT_EQ(f.determinant_sign, truth.sign) << "n " << n << " seed " << seed;
            EXPECT_NEAR(f.determinant_log, truth.log, n * kEps * reference::condition(a) + 4 * n * kEps);
          }
}

TEST(Condition, EstimateIsWithinAFactorOfTenBelowTheTruth) {
  for (const Values values : {Values::positive, Values::indefinite, Values::general})
    for (std::uint64_t seed = 0; seed < 6; ++seed)
      for (const Index n : {1, 2, 17, 80}) {
        const SparseMatrix a = reference::random_system(n, 5, values, seed);
        Solver s(two_threads());
        ASSERT_TRUE(s.analyze(a).status.ok());
        ASSERT_TRUE(s.factorize(a).status.ok());
        const double truth = reference::condition(a), estimate = s.condition_estimate().estimate;
        EXPECT_LE(estimate, truth * (1 + 1e-6));
        EXPECT_GE(estimate, truth / 10) << "n " << n << " seed " << seed;
      }
}

// ---- singular matrices ----------------------------------------------------------------------------------------------

TEST(Singular, ZeroEigenvaluesAreCountedAndRowsNamed) {
  // A graph Laplacian has one zero eigenvalue for each of its connected parts: exact in integers.
  for (const Index parts : {1, 3, 6})
    for (const Kind kind : {Kind::automatic, Kind::ldlt, Kind::lu}) {
      const Index size = 40, n = parts * size;
      std::vector<Triple> t;
      std::vector<double> degree(static_cast<std::size_t>(n), 0);
      for (Index k = 0; k < n; ++k)
        for (const Index step : {1, 7})
          if (k / size == (k + step) / size && k + step < n) {
            t.push_back({k + step, k, -1});
            ++degree[static_cast<std::size_t>(k)];
            ++degree[static_cast<std::size_t>(k + step)];
          }
      for (Index k = 0; k < n; ++k) t.push_back({k, k, degree[static_cast<std::size_t>(k)]});
      Options o = two_threads();
      o.kind = kind;
      Solver s(o);
      const SparseMatrix a = reference::from_triples(n, t, Storage::symmetric_lower);
      ASSERT_TRUE(s.analyze(a).status.ok());
      const FactorResult f = s.factorize(a);
      EXPECT_EQ(f.status.code, StatusCode::singular) << f.status.message;
      EXPECT_EQ(f.perturbed, parts);
      EXPECT_EQ(f.determinant_sign, 0);
      EXPECT_GE(f.status.row, 0);
      EXPECT_NE(f.status.message.find("row"), std::string::npos);
      if (kind != Kind::lu) {
        EXPECT_EQ(f.inertia.zero, parts);
        EXPECT_EQ(f.inertia.positive, n - parts);
        EXPECT_EQ(f.inertia.negative, 0);
      }
      EXPECT_EQ(s.state(), Solver::State::analyzed);
      std::vector<double> regular = a.values;  // the same pattern, a little stiffer
      for (std::size_t q = 0; q < regular.size(); ++q)
        if (regular[q] > 0) regular[q] += 1;
      EXPECT_TRUE(s.refactorize(regular).status.ok());
    }
}

TEST(Singular, RedundantConstraintsAreCounted) {
  for (const char* k : {"1", "3"}) {
    const SparseMatrix a = generated({"kkt-redundant", k, "2", "2", "2", "2"});
    Solver s(two_threads());
    ASSERT_TRUE(s.analyze(a).status.ok());
    const FactorResult f = s.factorize(a);
    EXPECT_EQ(f.status.code, StatusCode::singular) << f.status.message;
    EXPECT_EQ(f.inertia.zero, std::stoi(k));
  }
}

TEST(Singular, PerturbationOnWishSolvesAConsistentSystem) {
  const SparseMatrix a =
      reference::from_triples(3, {{0, 0, 1}, {1, 0, -1}, {1, 1, 2}, {2, 1, -1}, {2, 2, 1}}, Storage::symmetric_lower);
  Options o = two_threads();
  o.kind = Kind::ldlt;
  o.perturbation = 1e-8;
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  const FactorResult f = s.factorize(a);
  ASSERT_TRUE(f.status.ok()) << f.status.message;
  EXPECT_EQ(f.perturbed, 1);
  const std::vector<double> b{1, -1, 0};  // in the range of A
  std::vector<double> x(3);
  EXPECT_TRUE(s.solve(b, x).status.ok());
  EXPECT_LE(reference::backward_error(a, b, x), 1e-10);
}

// ---- elimination orders and moved pivots ----------------------------------------------------------------------------

TEST(Permutation, OfTheCallerIsUsedAndChecked) {
  const Index n = 120;
  for (const Values values : {Values::positive, Values::indefinite, Values::general})
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
      Options o = two_threads();
      o.permutation = matrix::random_permutation(n, seed);
      const SparseMatrix a = reference::random_system(n, 4, values, seed);
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      ASSERT_TRUE(s.factorize(a).status.ok());
      expect_small_error(s, a);
    }
  // The natural order of a line has no fill: n + (n - 1) entries; one that takes every other unknown first has more.
  std::vector<Triple> t;
  for (Index k = 0; k < n; ++k) {
    t.push_back({k, k, 4});
    if (k > 0) t.push_back({k, k - 1, -1});
  }
  for (const std::vector<Index>& wrong : {std::vector<Index>{0, 1}, std::vector<Index>(static_cast<std::size_t>(n), 0),
                                          std::vector<Index>(static_cast<std::size_t>(n), -1)}) {
    Options o = two_threads();
    o.permutation = wrong;
    Solver s(o);
    EXPECT_EQ(s.analyze(reference::from_triples(n, t, Storage::symmetric_lower)).status.code,
              StatusCode::invalid_input);
  }
}

TEST(MovedPivots, ConstraintsFirstWithoutMatching) {
  // The caller eliminates the multipliers (zero diagonal) first: nothing but moving them to later fronts helps.
  for (std::uint64_t seed = 0; seed < 4; ++seed)
    for (const Index n : {30, 160, 400}) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << " n " << n);
      const SparseMatrix a = reference::saddle_point(n, n / 4, seed);
      std::vector<char> has_diagonal(static_cast<std::size_t>(a.rows), 0);
      for (Index c = 0; c < a.cols; ++c)
        for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
          if (a.row_ind[static_cast<std::size_t>(q)] == c) has_diagonal[static_cast<std::size_t>(c)] = 1;
      Options o = two_threads();
      o.matching = false;
      for (const char wanted : {0, 1})
        for (Index k = 0; k < a.rows; ++k)
          if (has_diagonal[static_cast<std::size_t>(k)] == wanted) o.permutation.push_back(k);
      expect_inertia(a, o);
    }
}

TEST(MovedPivots, SmallDiagonalsThatMatchingCannotSee) {
  // Tiny diagonals in a natural order: growth above 1/u, or a vanishing pivot, in nearly every small front.
  for (const Kind kind : {Kind::ldlt, Kind::lu})
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
      SparseMatrix a = reference::random_system(200, 4, Values::indefinite, seed);
      for (Index c = 0; c < a.cols; ++c)
        for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
          if (a.row_ind[static_cast<std::size_t>(q)] == c && c % 3 != 0) a.values[static_cast<std::size_t>(q)] *= 1e-9;
      Options o = two_threads();
      o.kind = kind;
      o.matching = false;
      o.permutation.resize(200);
      std::iota(o.permutation.begin(), o.permutation.end(), 0);
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      const FactorResult f = s.factorize(a);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      EXPECT_GT(f.delayed, 0) << "the test wants pivots that fail";
      expect_small_error(s, a);
      if (kind == Kind::ldlt) {
        EXPECT_EQ(f.inertia.negative, reference::signs(a, 1e-13).negative);
      }
    }
}

// ---- memory, figures -----------------------------------------------------------------------------------------

TEST(Memory, TooSmallABudgetNamesTheOneNeeded) {
  const SparseMatrix a = generated({"elasticity", "6"});
  Solver free_solver(two_threads());
  ASSERT_TRUE(free_solver.analyze(a).status.ok());
  ASSERT_TRUE(free_solver.factorize(a).status.ok());
  Options o = two_threads();
  o.host_memory_bytes = 200000;
  Solver s(o);
  Status status = s.analyze(a).status;
  if (status.ok()) status = s.factorize(a).status;
  EXPECT_EQ(status.code, StatusCode::out_of_memory);
  EXPECT_NE(status.message.find("budget of at least"), std::string::npos) << status.message;
  const SparseMatrix small = reference::random_system(20, 4, Values::positive, 45);
  ASSERT_TRUE(s.analyze(small).status.ok());
  const FactorResult f = s.factorize(small);
  ASSERT_TRUE(f.status.ok()) << f.status.message;
  expect_small_error(s, small);
}

TEST(Memory, PredictionIsWhatIsTaken) {
  for (const auto& words : std::vector<std::vector<std::string>>{
           {"elasticity", "8"}, {"plate", "30", "30"}, {"kkt", "3", "6", "4", "4"}, {"gyroscopic", "6"}}) {
    const SparseMatrix a = generated(words);
    Options o = two_threads();
    o.device = "cpu";  // where a GPU is chosen, the factor is not in host memory
    Solver s(o);
    const AnalysisResult r = s.analyze(a);
    ASSERT_TRUE(r.status.ok());
    const FactorResult f = s.factorize(a);
    ASSERT_TRUE(f.status.ok());
    EXPECT_GE(f.peak_host_bytes, r.predicted_bytes * 9 / 10) << words[0];
    EXPECT_LE(f.peak_host_bytes, r.predicted_bytes * 5 / 4 + (4 << 20)) << words[0];
  }
}

TEST(Figures, TiersAddUp) {
  const SparseMatrix a = generated({"elasticity", "6"});
  Solver s(two_threads());
  const AnalysisResult r = s.analyze(a);
  double flops = 0;
  Offset entries = 0;
  Index fronts = 0;
  const auto tiers = s.tiers();
  EXPECT_EQ(static_cast<Index>(tiers.size()), r.tiers);
  for (const auto& t : tiers) {
    flops += t.flops;
    entries += t.factor_entries;
    fronts += t.fronts;
  }
  EXPECT_NEAR(flops, r.flops, 1e-12 * r.flops);
  EXPECT_EQ(entries, r.nonzeros_factor);
  EXPECT_EQ(fronts, r.fronts);
}

}  // namespace results_test
}  // namespace espalier
