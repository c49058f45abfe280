// Truth: whole solutions by the same factor, to the last bit; dense solutions; residuals of whole solutions.
#include "espalier/solve_rows.hpp"

#include <cmath>
#include <limits>
#include <random>

#include "solver/complex_common.hpp"
#include "solver/rows_common.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace solve_rows_test {

using namespace test;

TEST(SolveRows, OfAllKindsAreThoseOfWholeSolutionsToTheBit) {
  std::mt19937 random(5);
  const std::vector<std::vector<std::string>> systems = {
      {"elasticity", "6"}, {"plate", "14"}, {"kkt", "3", "2", "1", "1"}, {"gyroscopic", "5"}};
  double least = 1;
  for (const auto& words : systems) {
    const SparseMatrix a = generated(words);
    for (const int threads : {1, 2, 3})
      for (const Precision precision : {Precision::fp64, Precision::fp32})
        for (const Index block : {0, 8}) {
          Options o = unrefined(threads);
          o.precision = precision;
          o.max_block_size = block;
          Solver s(o);
          ASSERT_TRUE(s.analyze(a).status.ok());
          const FactorResult f = s.factorize(a);
          ASSERT_TRUE(f.status.ok()) << f.status.message;
          if (f.perturbed > 0) continue;
          for (const Index columns : {1, 3, 40})
            for (const Transpose t : {Transpose::no, Transpose::yes}) {
              SCOPED_TRACE(words[0] + ", " + std::to_string(threads) + " threads, " + std::to_string(columns));
              least = std::min(least, expect_bits_of_whole(s, RowsCase<double>(a.rows, columns, random), a.rows, t));
            }
        }
  }
  EXPECT_LT(least, 0.5) << "a part of the factor suffices somewhere";
}

// Memory of a host device that the factor does not fit in.
TEST(SolveRows, OutOfCoreAreThoseOfWholeSolutionsToTheBit) {
  std::mt19937 random(7);
  double least = 1;
  for (const auto& words :
       std::vector<std::vector<std::string>>{{"elasticity", "9"}, {"kkt", "6", "3", "2", "2"}, {"gyroscopic", "8"}})
    for (const char* device : {"host:1", "host:2,1"}) {
      const SparseMatrix a = generated(words);
      Options o = unrefined(2);
      o.device = device;
      o.device_memory_bytes = 2'500'000;
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      const FactorResult f = s.factorize(a);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      for (const Index columns : {1, 3, 40})
        for (const Transpose t : {Transpose::no, Transpose::yes}) {
          SCOPED_TRACE(words[0] + ", " + device + ", " + std::to_string(columns));
          least = std::min(least, expect_bits_of_whole(s, RowsCase<double>(a.rows, columns, random), a.rows, t));
        }
    }
  EXPECT_LT(least, 0.5) << "a part of the factor suffices somewhere";
}

TEST(SolveRows, OfComplexSystemsInEitherFormAreThoseOfWholeSolutions) {
  std::mt19937 random(6);
  int compared = 0;
  for (unsigned run = 0; run < 96; ++run) {
    const Sort sort = static_cast<Sort>(run % 4);
    const Index n = 1 + static_cast<Index>(run * 7 % 90);
    const Dense a = random_dense(n, sort, run);
    std::optional<AsRealForm> form;
    if (run / 4 % 2 == 1) form.emplace();
    Options o = unrefined(1 + static_cast<int>(run % 3));
    o.max_block_size = run % 5 == 0 ? 8 : 0;
    ComplexSolver s(o);
    const Storage storage = sort == Sort::general     ? Storage::general
                            : sort == Sort::symmetric ? Storage::symmetric_lower
                                                      : Storage::hermitian_lower;
    const ComplexSparseMatrix m = sparse(a, storage);
    if (!s.analyze(m).status.ok()) continue;
    const ComplexFactorResult f = s.factorize(m);
    if (!f.status.ok() || f.perturbed > 0) continue;
    SCOPED_TRACE("run " + std::to_string(run) + ", n " + std::to_string(n));
    for (const Transpose t : {Transpose::no, Transpose::yes, Transpose::conjugate}) {
      expect_bits_of_whole(s, RowsCase<Value>(n, 1 + static_cast<Index>(run % 35), random), n, t);
      ++compared;
    }
  }
  EXPECT_GT(compared, 200);
}

TEST(SolveRows, SayHowGoodTheFactorIsAndReadAPartOfIt) {
  const SparseMatrix a = generated({"elasticity", "8"});
  Solver s(two_threads());
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  const double before = expect_one_row(s, a.rows);

  // Another factor has another error, and other solutions.
  SparseMatrix twice = a;
  for (double& v : twice.values) v *= 2;
  ASSERT_TRUE(s.refactorize(twice.values).status.ok());
  EXPECT_NEAR(expect_one_row(s, a.rows), before / 2, 1e-12 * std::abs(before));
}

// A static pivot perturbs the factor: only refinement gives digits there.
TEST(SolveRows, OfPerturbedFactorsAreRefined) {
  const SparseMatrix a = reference::from_triples(
      4, {{0, 0, 1e-30}, {1, 0, 1}, {2, 0, 2}, {1, 1, 1e-30}, {2, 1, 1}, {3, 3, 1}, {3, 2, 1}, {2, 2, 3}},
      Storage::symmetric_lower);
  Options o = two_threads();
  o.kind = Kind::ldlt;
  o.perturbation = 1e-3;
  o.pivot_threshold = 0;
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  const std::vector<double> b = {0, 1, 0, 0};
  std::vector<double> whole(4), x(2);
  const SolveResult w = s.solve(b, whole);
  const std::vector<Offset> one = {0, 1};
  const std::vector<Index> row = {1}, wanted = {2, 0};
  const std::vector<double> load = {1};
  const SolveRowsResult r = solve_rows(s, {one, row, load}, wanted, x);
  EXPECT_EQ(r.status.code, w.status.code);
  EXPECT_LE(r.backward_error, 1e-14);
  EXPECT_NEAR(x[0], whole[2], 1e-12);
  EXPECT_NEAR(x[1], whole[0], 1e-12);
}

// A factor in single precision is not good enough: solutions are whole and refined, many at a time.
TEST(SolveRows, OfMixedPrecisionAreRefined) {
  const SparseMatrix a = generated({"elasticity", "5"});
  Options o = two_threads();
  o.precision = Precision::mixed;
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  const Index columns = 100;
  std::vector<Offset> ptr{0};
  std::vector<Index> rows, wanted{2, 0};
  for (Index c = 0; c < columns; ++c) {
    rows.push_back(3 * c);
    ptr.push_back(c + 1);
  }
  const std::vector<double> loads(rows.size(), 1);
  std::vector<double> x(2 * rows.size());
  const SolveRowsResult r = solve_rows(s, {ptr, rows, loads}, wanted, x);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_EQ(r.share, 1);
  EXPECT_GT(r.refinement_steps, 0);
  EXPECT_GT(r.backward_error, 0);
  EXPECT_LE(r.backward_error, 1e-15);
  for (Index c = 0; c < columns; ++c) {
    std::vector<double> b(static_cast<std::size_t>(a.cols), 0.0), whole(b.size());
    b[static_cast<std::size_t>(3 * c)] = 1;
    ASSERT_TRUE(s.solve(b, whole).status.ok());
    EXPECT_NEAR(x[2 * static_cast<std::size_t>(c)], whole[2], 1e-13);
    EXPECT_NEAR(x[2 * static_cast<std::size_t>(c) + 1], whole[0], 1e-13);
  }
}

TEST(SolveRows, RefuseWhatDoesNotFit) {
  const SparseMatrix a = generated({"elasticity", "3"});
  Solver s(two_threads());
  std::vector<Offset> one = {0, 1};
  std::vector<Index> row = {0}, wanted = {1};
  std::vector<double> load = {1}, x(1);
  EXPECT_THROW(solve_rows(s, {one, row, load}, wanted, x), std::logic_error);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  std::vector<double> two(2);
  EXPECT_THROW(solve_rows(s, {one, row, load}, wanted, two), std::invalid_argument);
  EXPECT_THROW(solve_rows(s, {{}, row, load}, wanted, x), std::invalid_argument);
  const auto message = [&] {
    const SolveRowsResult r = solve_rows(s, {one, row, load}, wanted, x);
    EXPECT_EQ(r.status.code, StatusCode::invalid_input);
    return r.status.message;
  };
  for (const Index wrong : {-1, a.rows}) {
    row[0] = wrong;
    EXPECT_NE(message().find("row " + std::to_string(wrong)), std::string::npos) << message();
    row[0] = 0;
    wanted[0] = wrong;
    EXPECT_NE(message().find("number " + std::to_string(wrong)), std::string::npos) << message();
    wanted[0] = 1;
  }
  load[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(message().find("not finite"), std::string::npos) << message();
  load[0] = 1;
  one = {0, 2};
  EXPECT_NE(message().find("columns"), std::string::npos) << message();
  // The factor is still there.
  one = {0, 1};
  EXPECT_TRUE(solve_rows(s, {one, row, load}, wanted, x).status.ok());
  // Nothing wanted, nothing given.
  EXPECT_TRUE(solve_rows(s, {one, row, load}, {}, {}).status.ok());
  const std::vector<Offset> none = {0, 0};
  EXPECT_TRUE(solve_rows(s, {none, {}, {}}, wanted, x).status.ok());
  EXPECT_EQ(x[0], 0);
}

}  // namespace solve_rows_test
}  // namespace espalier
