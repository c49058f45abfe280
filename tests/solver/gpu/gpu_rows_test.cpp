// Solves that touch a part of the tree on a GPU. Truth: whole solutions by the same factor, to the last bit; for what
// happens between calls, solutions of the host.
#include "solver/gpu/gpu_fixture.hpp"
#include "solver/rows_common.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace gpu_rows_test {

using namespace test;

using GpuRows = OnGpu;

Options on_gpu(Precision precision) {
  Options o = unrefined(2);
  o.device = "gpu:0";
  o.precision = precision;
  return o;
}

TEST_F(GpuRows, OfAllKindsAreThoseOfWholeSolutionsToTheBit) {
  std::mt19937 random(5);
  const std::vector<std::vector<std::string>> systems = {
      {"elasticity", "14"}, {"plate", "40"}, {"kkt", "6", "3", "2", "2"}, {"gyroscopic", "10"}, {"poisson", "3"}};
  double least = 1;
  int compared = 0;
  for (const auto& words : systems) {
    const SparseMatrix a = generated(words);
    for (const Precision precision : {Precision::fp64, Precision::fp32}) {
      Solver s(on_gpu(precision));
      ASSERT_TRUE(s.analyze(a).status.ok());
      const FactorResult f = s.factorize(a);
      ASSERT_TRUE(f.status.ok()) << f.status.message;
      if (f.perturbed > 0) continue;
      for (const Index columns : {1, 2, 8, 16, 27, 40})
        for (const Transpose t : {Transpose::no, Transpose::yes}) {
          SCOPED_TRACE(words[0] + ", precision " + std::to_string(static_cast<int>(precision)) + ", " +
                       std::to_string(columns) + " columns, transpose " + std::to_string(static_cast<int>(t)));
          least = std::min(least, expect_bits_of_whole(s, RowsCase<double>(a.rows, columns, random), a.rows, t));
          ++compared;
        }
    }
  }
  EXPECT_GE(compared, 96);
  EXPECT_LT(least, 0.5) << "a part of the factor suffices somewhere";
}

// Whole solves, rows, other values, more columns: none disturbs the next.
TEST_F(GpuRows, TakeTurnsWithOtherCalls) {
  SparseMatrix a = generated({"elasticity", "10"});
  Solver s(on_gpu(Precision::fp64)), host(unrefined(2));
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(host.analyze(a).status.ok());
  std::mt19937 random(8);
  for (int turn = 0; turn < 60; ++turn) {
    if (turn % 5 == 0) {
      for (double& v : a.values) v *= 1.25;
      ASSERT_TRUE(s.factorize(a).status.ok());
      ASSERT_TRUE(host.factorize(a).status.ok());
    }
    const Index columns = 1 + static_cast<Index>(random() % 40);
    const RowsCase<double> given(a.rows, columns, random);
    SCOPED_TRACE("turn " + std::to_string(turn));
    if (turn % 3 == 0) (void)expect_bits_of_whole(s, given, a.rows, Transpose::no);
    std::vector<double> x(given.rows.size() * static_cast<std::size_t>(columns)), y(x.size());
    ASSERT_TRUE(solve_rows(s, given.b(), given.rows, x).status.ok());
    ASSERT_TRUE(solve_rows(host, given.b(), given.rows, y).status.ok());
    for (std::size_t k = 0; k < x.size(); ++k) EXPECT_NEAR(x[k], y[k], 1e-9 * (1 + std::abs(y[k])));
  }
}

// The factor is looked at on the device.
TEST_F(GpuRows, SayHowGoodTheFactorIs) {
  const SparseMatrix a = generated({"elasticity", "10"});
  Options o;
  o.device = "gpu:0";
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  (void)expect_one_row(s, a.rows);
}

// Where device memory is too small for the factor, or for the tables, the numbers are the same.
TEST_F(GpuRows, OutOfCoreAreThoseOfWholeSolutionsToTheBit) {
  const SparseMatrix a = generated({"elasticity", "16"});
  std::mt19937 random(9);
  for (const Offset memory : {Offset{8'000'000}, Offset{14'000'000}, Offset{24'000'000}}) {
    Options o = on_gpu(Precision::fp64);
    o.device_memory_bytes = memory;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const FactorResult f = s.factorize(a);
    ASSERT_TRUE(f.status.ok()) << f.status.message;
    for (const Index columns : {1, 3, 40}) {
      SCOPED_TRACE(std::to_string(memory) + " bytes, " + std::to_string(columns));
      (void)expect_bits_of_whole(s, RowsCase<double>(a.rows, columns, random), a.rows, Transpose::no);
    }
  }
}

}  // namespace gpu_rows_test
}  // namespace espalier
