// The solver through its public interface: use and misuse, kinds, and right-hand sides. The truth is the
// dense matrix (residual in long double, eigenvalues and determinants by Eigen).
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/generators/random.hpp"
#include "matrix/transform.hpp"
#include "solver/gpu/gpu_fixture.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace solver_test {

using reference::Triple;
using reference::Values;
using namespace test;

// More right-hand sides than are refined side by side.
TEST(SolverColumns, ManyAreSolvedEachAsItIsAlone) {
  const Index n = 60, count = 150;
  for (const Values values : {Values::positive, Values::general}) {
    const SparseMatrix a = reference::random_system(n, 4, values, 3);
    Solver s(two_threads());
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    const std::vector<double> b = reference::random_vector(std::int64_t{n} * count, 7);
    std::vector<double> x(b.size());
    const SolveResult all = s.solve(b, x, count);
    ASSERT_TRUE(all.status.ok()) << all.status.message;
    EXPECT_LE(reference::backward_error(a, b, x, count, false), 8 * kEps);
    double worst = 0;
    for (std::size_t k = 0; k < b.size(); k += n) {
      const std::vector<double> one(b.begin() + static_cast<std::ptrdiff_t>(k),
                                    b.begin() + static_cast<std::ptrdiff_t>(k + n));
      std::vector<double> alone(one.size());
      const SolveResult r = s.solve(one, alone);
      worst = std::max(worst, r.backward_error);
      for (std::size_t i = 0; i < alone.size(); ++i) ASSERT_NEAR(x[k + i], alone[i], 1e-9 * std::abs(alone[i]) + 1e-12);
    }
    EXPECT_LE(all.backward_error, 4 * worst + kEps);
    EXPECT_GE(all.backward_error, worst / 4) << "the largest of all columns";
  }
}

// ---- use and misuse -------------------------------------------------------------------------------------------------

TEST(SolverState, CallsOutOfOrderThrow) {
  const SparseMatrix a = reference::random_system(20, 4, Values::positive, 1);
  Solver s(two_threads());
  std::vector<double> x(20);
  EXPECT_EQ(s.state(), Solver::State::empty);
  EXPECT_THROW((void)s.factorize(a), std::logic_error);
  EXPECT_THROW((void)s.refactorize(a.values), std::logic_error);
  EXPECT_THROW((void)s.solve(x, x), std::logic_error);
  EXPECT_THROW((void)s.condition_estimate(), std::logic_error);
  EXPECT_THROW((void)s.save_analysis("unused"), std::logic_error);
  EXPECT_THROW((void)s.write_trace("unused"), std::logic_error);
  EXPECT_TRUE(s.tiers().empty());
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_EQ(s.state(), Solver::State::analyzed);
  EXPECT_THROW((void)s.solve(x, x), std::logic_error);
  EXPECT_THROW((void)s.refactorize(std::span<const double>(a.values).first(3)), std::invalid_argument);
  ASSERT_TRUE(s.factorize(a).status.ok());
  EXPECT_EQ(s.state(), Solver::State::factorized);
  std::vector<double> wrong(21);
  EXPECT_THROW((void)s.solve(wrong, x), std::invalid_argument);
  EXPECT_THROW((void)s.solve(x, wrong), std::invalid_argument);
  EXPECT_THROW((void)s.solve(x, x, 2), std::invalid_argument);
  EXPECT_THROW((void)s.solve({}, {}, 0), std::invalid_argument);
  EXPECT_THROW((void)s.solve(x, x, -1), std::invalid_argument);
}

TEST(SolverState, FailedAnalysisLeavesAnEmptySolverThatWorksAgain) {
  const SparseMatrix good = reference::random_system(30, 4, Values::indefinite, 2);
  SparseMatrix bad = good;
  bad.values[3] = std::numeric_limits<double>::quiet_NaN();
  Solver s(two_threads());
  expect_solved(s, good);
  const AnalysisResult r = s.analyze(bad);
  EXPECT_EQ(r.status.code, StatusCode::invalid_input);
  EXPECT_NE(r.status.message.find("nan"), std::string::npos) << r.status.message;
  EXPECT_EQ(s.state(), Solver::State::empty);
  expect_solved(s, good);
}

TEST(SolverState, FailedFactorizationForbidsSolve) {
  SparseMatrix a = diagonal({1, 2, 3, 4});
  Options o = two_threads();
  o.kind = Kind::llt;
  Solver s(o);
  expect_solved(s, a);
  a.values[2] = -3;
  const FactorResult r = s.refactorize(a.values);
  EXPECT_EQ(r.status.code, StatusCode::not_positive_definite);
  EXPECT_EQ(r.status.row, 2);
  EXPECT_EQ(s.state(), Solver::State::analyzed);
  std::vector<double> x(4, 1);
  EXPECT_THROW((void)s.solve(x, x), std::logic_error);
  a.values[2] = 3;
  EXPECT_TRUE(s.refactorize(a.values).status.ok());
  EXPECT_TRUE(s.solve(x, x).status.ok());
  EXPECT_NEAR(x[2], 1.0 / 3, 4 * kEps);
}

TEST(SolverState, NotFiniteNewValuesAreRefusedByName) {
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
    for (const Precision precision : {Precision::fp64, Precision::fp32, Precision::mixed})
      for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
        const SparseMatrix a = reference::random_system(60, 5, Values::positive, 3);
        Options o = two_threads();
        o.kind = kind;
        o.precision = precision;
        Solver s(o);
        ASSERT_TRUE(s.analyze(a).status.ok());
        std::vector<double> values = a.values;
        values[17] = bad;
        const FactorResult r = s.refactorize(values);
        EXPECT_EQ(r.status.code, StatusCode::invalid_input) << r.status.message;
        EXPECT_GE(r.status.row, 0);
        EXPECT_EQ(s.state(), Solver::State::analyzed);
        EXPECT_TRUE(s.refactorize(a.values).status.ok());
      }
}

TEST(SolverState, AnotherPatternIsDetected) {
  const SparseMatrix a = reference::from_triples(2, {{0, 0, 2}, {1, 0, 1}, {1, 1, 3}}, Storage::symmetric_lower);
  SparseMatrix other = a;
  other.col_ptr = {0, 1, 3};  // (1, 1) twice; rows as before
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    Options o = two_threads();
    o.kind = kind;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    EXPECT_EQ(s.factorize(other).status.code, StatusCode::invalid_input);
    EXPECT_EQ(s.factorize(diagonal({1, 2})).status.code, StatusCode::invalid_input);
    EXPECT_EQ(s.factorize(diagonal({1, 2, 3})).status.code, StatusCode::invalid_input);
    EXPECT_TRUE(s.factorize(a).status.ok());
  }
}

TEST(SolverState, ValuesThatLoseTheirSymmetryAreRefused) {
  const SparseMatrix lower = reference::random_system(40, 5, Values::positive, 4);
  const SparseMatrix a = reference::stored_as(lower, Storage::general);
  SparseMatrix b = a;
  for (std::size_t q = 0; q < b.values.size(); ++q)
    if (b.row_ind[q] == 0 && q > static_cast<std::size_t>(b.col_ptr[1])) b.values[q] *= 2;
  ASSERT_NE(a.values, b.values);
  Solver s(two_threads());
  expect_solved(s, a);
  EXPECT_EQ(s.analysis().kind, Kind::llt);
  EXPECT_EQ(s.factorize(b).status.code, StatusCode::invalid_input);
  EXPECT_EQ(s.refactorize(b.values).status.code, StatusCode::invalid_input);
  expect_solved(s, b);  // a new analysis takes lu
  EXPECT_EQ(s.analysis().kind, Kind::lu);
}

TEST(SolverState, RefactorizeFollowsChangedValues) {
  for (const Values values : {Values::positive, Values::indefinite, Values::general}) {
    SparseMatrix a = reference::random_system(150, 6, values, 5);
    Solver s(two_threads());
    expect_solved(s, a);
    for (int round = 0; round < 3; ++round) {
      for (std::size_t q = 0; q < a.values.size(); ++q)
        a.values[q] *= 1 + 0.1 * matrix::random_unit(static_cast<std::uint64_t>(round), q);
      if (values == Values::positive)  // keep it dominated by its diagonal
        for (Index c = 0; c < a.cols; ++c)
          for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q)
            if (a.row_ind[static_cast<std::size_t>(q)] == c) a.values[static_cast<std::size_t>(q)] *= 1.2;
      const FactorResult f = s.refactorize(a.values);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      const std::vector<double> b = reference::random_vector(150, 6);
      std::vector<double> x(150);
      EXPECT_TRUE(s.solve(b, x).status.ok());
      EXPECT_LE(reference::backward_error(a, b, x), 8 * kEps);
    }
  }
}

// ---- kinds ----------------------------------------------------------------------------------------------------------

TEST(SolverKind, AutomaticChoiceAndFallback) {
  const auto kind_of = [](const MatrixView& a) {
    Solver s(two_threads());
    expect_solved(s, a);
    return s.analysis().kind;
  };
  EXPECT_EQ(kind_of(reference::random_system(50, 5, Values::positive, 11)), Kind::llt);
  EXPECT_EQ(kind_of(reference::random_system(50, 5, Values::indefinite, 11)), Kind::ldlt);
  EXPECT_EQ(kind_of(reference::random_system(50, 5, Values::general, 11)), Kind::lu);
  EXPECT_EQ(kind_of(reference::saddle_point(40, 10, 11)), Kind::ldlt);
  // Positive diagonal, eigenvalues 3 and -1 in each block: llt is tried and given up.
  for (const Storage storage : {Storage::symmetric_lower, Storage::general, Storage::symmetric_both}) {
    std::vector<Triple> t;
    for (Index k = 0; k < 40; k += 2) {
      t.push_back({k, k, 1});
      t.push_back({k + 1, k, 2});
      t.push_back({k + 1, k + 1, 1});
      if (k > 0) t.push_back({k, k - 1, 0.1});
    }
    const SparseMatrix a = reference::stored_as(reference::from_triples(40, t, Storage::symmetric_lower), storage);
    Solver s(two_threads());
    ASSERT_TRUE(s.analyze(a).status.ok());
    EXPECT_EQ(s.analysis().kind, Kind::llt);
    const FactorResult f = s.factorize(a);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    EXPECT_EQ(s.analysis().kind, Kind::ldlt);
    const reference::Signs signs = reference::signs(a, 1e-12);
    EXPECT_EQ(f.inertia.negative, signs.negative);
    const std::vector<double> b = reference::random_vector(40, 2);
    std::vector<double> x(40);
    EXPECT_TRUE(s.solve(b, x).status.ok());
    EXPECT_LE(reference::backward_error(a, b, x), 8 * kEps);
    // The next factorization keeps the kind, and the pattern is still known.
    EXPECT_TRUE(s.factorize(a).status.ok());
    EXPECT_TRUE(s.refactorize(a.values).status.ok());
  }
}

TEST(SolverKind, ValuesThatNoKindTakesDoNotCostTheAnalysis) {
  const SparseMatrix a = reference::random_system(50, 5, Values::positive, 11);
  Solver s(two_threads());
  ASSERT_TRUE(s.analyze(a).status.ok());
  const std::vector<double> zeros(a.values.size(), 0.0);
  EXPECT_EQ(s.refactorize(zeros).status.code, StatusCode::singular);
  EXPECT_EQ(s.state(), Solver::State::analyzed);
  ASSERT_TRUE(s.refactorize(a.values).status.ok());
  EXPECT_EQ(s.analysis().kind, Kind::llt);
  const std::vector<double> b = reference::random_vector(50, 3);
  std::vector<double> x(50);
  EXPECT_TRUE(s.solve(b, x).status.ok());
  EXPECT_LE(reference::backward_error(a, b, x), 8 * kEps);
}

TEST(SolverKind, NotPositiveDefiniteNamesTheRow) {
  for (const Index bad : {0, 5, 149}) {
    SparseMatrix a = reference::random_system(150, 5, Values::positive, 12);
    for (Offset q = a.col_ptr[static_cast<std::size_t>(bad)]; q < a.col_ptr[static_cast<std::size_t>(bad) + 1]; ++q)
      if (a.row_ind[static_cast<std::size_t>(q)] == bad) a.values[static_cast<std::size_t>(q)] *= -1;
    Options o = two_threads();
    o.kind = Kind::llt;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const FactorResult f = s.factorize(a);
    EXPECT_EQ(f.status.code, StatusCode::not_positive_definite);
    // Dominated by its diagonal up to that sign, every Schur complement keeps the signs: that pivot and no other.
    EXPECT_EQ(f.status.row, bad) << f.status.message;
  }
}

// ---- right-hand sides -----------------------------------------------------------------------------------------------

TEST(SolverSolve, ManyRightHandSidesAliasingAndTranspose) {
  for (const Values values : {Values::positive, Values::indefinite, Values::general}) {
    const SparseMatrix a = reference::random_system(130, 6, values, 13);
    Solver s(two_threads());
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    for (const Index columns : {1, 2, 7, 8, 9, 33})
      for (const Transpose op : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
        const bool transpose = op != Transpose::no;
        SCOPED_TRACE(testing::Message() << "columns " << columns << " transpose " << static_cast<int>(op));
        const std::vector<double> b = reference::random_vector(130 * static_cast<std::int64_t>(columns), 14);
        std::vector<double> x(b.size()), aliased(b);
        EXPECT_TRUE(s.solve(b, x, columns, op).status.ok());
        EXPECT_LE(reference::backward_error(a, b, x, columns, transpose), 8 * kEps);
        EXPECT_TRUE(s.solve(aliased, aliased, columns, op).status.ok());
        EXPECT_EQ(std::memcmp(x.data(), aliased.data(), x.size() * sizeof(double)), 0);
        const std::vector<double> truth = reference::solve(a, b, columns, transpose);
        double most = 0, difference = 0;
        for (std::size_t k = 0; k < x.size(); ++k) {
          most = std::max(most, std::abs(truth[k]));
          difference = std::max(difference, std::abs(truth[k] - x[k]));
        }
        EXPECT_LE(difference, 130 * kEps * reference::condition(a) * most);
      }
  }
}

// Then solutions take the place of the right-hand sides without a copy, more of them than a sweep takes, too.
TEST(SolverSolve, AliasingWithoutRefinementGivesTheSameBits) {
  Options o = two_threads();
  o.refinement_steps = 0;
  o.required_backward_error = std::numeric_limits<double>::infinity();
  const SparseMatrix a = reference::random_system(130, 6, Values::general, 13);
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  for (const Index columns : {1, 8, 70})
    for (const Transpose op : {Transpose::no, Transpose::yes}) {
      const std::vector<double> b = reference::random_vector(130 * static_cast<std::int64_t>(columns), 14);
      std::vector<double> x(b.size()), aliased(b);
      EXPECT_TRUE(s.solve(b, x, columns, op).status.ok());
      EXPECT_TRUE(s.solve(aliased, aliased, columns, op).status.ok());
      EXPECT_EQ(x, aliased) << columns;
      EXPECT_LE(reference::backward_error(a, b, x, columns, op == Transpose::yes), 1e-12) << columns;
    }
}

TEST(SolverSolve, OverlappingButNotEqualRangesAndZeroRightHandSide) {
  const SparseMatrix a = reference::random_system(50, 5, Values::positive, 15);
  Solver s(two_threads());
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  const std::vector<double> b = reference::random_vector(50, 16);
  std::vector<double> shared(75, 0.0);
  std::copy(b.begin(), b.end(), shared.begin() + 25);
  std::span<double> all(shared);
  EXPECT_TRUE(s.solve(all.subspan(25, 50), all.subspan(0, 50)).status.ok());
  EXPECT_LE(reference::backward_error(a, b, {shared.begin(), shared.begin() + 50}), 8 * kEps);
  std::vector<double> zero(50, 0.0), x(50, 3.0);
  const SolveResult r = s.solve(zero, x);
  EXPECT_TRUE(r.status.ok());
  EXPECT_EQ(r.backward_error, 0);
  for (const double e : x) EXPECT_EQ(e, 0);
}

TEST(SolverSolve, NotFiniteRightHandSideIsReportedNotPassedOff) {
  const SparseMatrix a = reference::random_system(50, 5, Values::indefinite, 17);
  for (const Precision precision : {Precision::fp64, Precision::fp32, Precision::mixed}) {
    Options o = two_threads();
    o.precision = precision;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    std::vector<double> b(50, 1.0), x(50);
    b[9] = std::numeric_limits<double>::quiet_NaN();
    const Status status = s.solve(b, x).status;
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    EXPECT_EQ(status.row, 9);
    EXPECT_NE(status.message.find("row 9 of right-hand side 0 is nan"), std::string::npos) << status.message;
    std::fill(b.begin(), b.end(), std::numeric_limits<double>::max());
    EXPECT_EQ(s.solve(b, x).status.code, StatusCode::accuracy_not_reached) << "the solution overflows";
    std::fill(b.begin(), b.end(), 1.0);
    EXPECT_TRUE(s.solve(b, x).status.ok());
  }
}

// On one device: `auto` may take a GPU for one thread and the processor for four.
void expect_same_bits_with_any_threads(const SparseMatrix& a, Precision precision, const std::string& device) {
  std::vector<double> first;
  const std::vector<double> b = reference::random_vector(3 * static_cast<std::int64_t>(a.rows), 18);
  for (const int threads : {1, 2, 4, 2}) {
    Options o;
    o.device = device;
    o.threads = threads;
    o.precision = precision;
    o.refinement_steps = 0;  // the factor itself
    o.required_backward_error = 1;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    ASSERT_TRUE(s.factorize(a).status.ok());
    std::vector<double> x(b.size());
    ASSERT_TRUE(s.solve(b, x, 3).status.ok());
    if (first.empty()) first = x;
    EXPECT_EQ(std::memcmp(first.data(), x.data(), x.size() * sizeof(double)), 0) << threads << " threads on " << device;
  }
}

TEST(SolverSolve, ThreadsAndRepetitionsGiveTheSameBits) {
  std::vector<std::string> devices{"cpu"};
  if (why_no_gpu().empty()) devices.emplace_back("gpu:0");
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"elasticity", "6"}, {"kkt", "3", "4", "3", "3"}, {"gyroscopic", "5"}}) {
    const SparseMatrix a = matrix::generate(matrix::parse_generator(words));
    for (const std::string& device : devices)
      for (const Precision precision : {Precision::fp64, Precision::mixed})
        expect_same_bits_with_any_threads(a, precision, device);
  }
}

TEST(SolverPrecision, Fp32AndMixed) {
  for (const Values values : {Values::positive, Values::indefinite, Values::general}) {
    const SparseMatrix a = reference::random_system(200, 6, values, 19);
    const std::vector<double> b = reference::random_vector(400, 20);
    for (const Precision precision : {Precision::fp32, Precision::mixed}) {
      Options o = two_threads();
      o.precision = precision;
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      const FactorResult f = s.factorize(a);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      std::vector<double> x(400);
      const SolveResult r = s.solve(b, x, 2);
      EXPECT_TRUE(r.status.ok()) << r.status.message;
      const double limit =
          precision == Precision::mixed ? 8 * kEps : 200 * static_cast<double>(std::numeric_limits<float>::epsilon());
      EXPECT_LE(reference::backward_error(a, b, x, 2), limit);
    }
  }
}

TEST(SolverPrecision, MixedOnIllConditionedSystemsIsAccurateOrHonest) {
  // Poisson on a line of n points has the condition 4 n^2 / pi^2: from harmless to beyond FP32 and then FP64's reach.
  for (const double shift : {1e-1, 1e-4, 1e-7, 1e-9, 1e-11}) {
    const Index n = 500;
    std::vector<Triple> t;
    for (Index k = 0; k < n; ++k) {
      t.push_back({k, k, (k == 0 || k + 1 == n ? 1 : 2) + shift});  // free ends: smallest eigenvalue = shift
      if (k > 0) t.push_back({k, k - 1, -1});
    }
    const SparseMatrix a = reference::from_triples(n, t, Storage::symmetric_lower);
    Options o = two_threads();
    o.precision = Precision::mixed;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const FactorResult f = s.factorize(a);
    if (!f.status.ok()) {
      EXPECT_EQ(f.status.code, StatusCode::singular) << shift;  // below FP32's rounding
      EXPECT_LT(shift, 1e-4);
      continue;
    }
    const std::vector<double> b = reference::random_vector(n, 21);
    std::vector<double> x(b.size());
    const SolveResult r = s.solve(b, x);
    const double error = reference::backward_error(a, b, x);
    EXPECT_NEAR(r.backward_error, error, 0.01 * error + kEps);
    if (r.status.ok()) {
      EXPECT_LE(error, 1e-10) << shift;
    } else {
      EXPECT_EQ(r.status.code, StatusCode::accuracy_not_reached);
    }
    EXPECT_LE(error, shift >= 1e-4 ? 8 * kEps : 1.0) << shift;
  }
}

}  // namespace solver_test
}  // namespace espalier
