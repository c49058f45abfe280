// Precision::automatic: when it is FP32 with refinement, and when it goes to FP64. Truth: independent residuals, and
// what Precision::mixed and fp64 do with the same matrix.
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"
#include "reference/reference.hpp"
#include "solver/options/precision_choice.hpp"

namespace espalier {
namespace precision_test {

constexpr double kEps = std::numeric_limits<double>::epsilon();

struct Outcome {
  Precision precision;
  SolveResult solve;
  double error;
  std::vector<std::string> log;
};

Outcome run(const SparseMatrix& a, Options o) {
  Outcome r;
  o.device = "cpu";
  o.threads = 2;
  o.log = [&](const std::string& line) { r.log.push_back(line); };
  Solver s(o);
  EXPECT_TRUE(s.analyze(a).status.ok());
  const FactorResult f = s.factorize(a);
  EXPECT_TRUE(f.status.ok()) << f.status.message;
  const std::vector<double> b = reference::random_vector(a.rows, 3);
  std::vector<double> x(b.size());
  r.solve = s.solve(b, x);
  r.precision = s.refactorize(a.values).precision;
  r.error = matrix::backward_errors(a, x, b, 1, Transpose::no, nullptr).normwise;
  return r;
}

SparseMatrix generated(const std::vector<std::string>& words) {
  return matrix::generate(matrix::parse_generator(words));
}

Options automatic() {
  Options o;
  o.precision = Precision::automatic;
  return o;
}

bool says(const Outcome& r, const std::string& words) {
  for (const std::string& line : r.log)
    if (line.find(words) != std::string::npos) return true;
  return false;
}

TEST(Precision, AutoTakesFp32WhereItGains) {
  const SparseMatrix a = generated({"elasticity", "14"});
  const Outcome r = run(a, automatic());
  EXPECT_EQ(r.precision, Precision::mixed);
  EXPECT_TRUE(r.solve.status.ok()) << r.solve.status.message;
  EXPECT_LE(r.error, 2 * kEps);
  EXPECT_GE(r.solve.refinement_steps, 2) << "a factor in FP32 needs them";
}

TEST(Precision, AutoTakesFp64ForSmallSystems) {
  const Outcome r = run(reference::random_system(200, 5, reference::Values::positive, 1), automatic());
  EXPECT_EQ(r.precision, Precision::fp64);
  EXPECT_LE(r.error, 2 * kEps);
}

TEST(Precision, AutoTakesFp64ForIllConditionedSystems) {
  SparseMatrix a = generated({"plate", "40"});
  Options o = automatic();
  o.machine = "host.single=100";  // however much it would gain
  const Outcome r = run(a, o);
  EXPECT_TRUE(r.solve.status.ok()) << r.solve.status.message;
  EXPECT_LE(r.error, 2 * kEps);
  EXPECT_TRUE(r.precision == Precision::mixed || says(r, "going on in FP64"));
}

// A thin plate's parts tell that FP32 will not do: no factor is made in vain. A solid body's do not.
TEST(Precision, AutoKnowsPlatesFromTheirParts) {
  const SparseMatrix plate = generated({"plate", "60"});
  Options o = automatic();
  o.machine = "host.single=100";
  const Outcome r = run(plate, o);
  EXPECT_EQ(r.precision, Precision::fp64);
  EXPECT_TRUE(says(r, "parts of the matrix"));
  EXPECT_FALSE(says(r, "going on in FP64")) << "a factor was made in vain";
  EXPECT_LE(r.error, 2 * kEps);
  const Outcome solid = run(generated({"elasticity", "20"}), o);
  EXPECT_EQ(solid.precision, Precision::mixed);
  EXPECT_FALSE(says(solid, "parts of the matrix"));
}

// One step of refinement leaves too large an error with a factor in FP32: the same call makes another one.
TEST(Precision, AutoKeepsItsPromiseOfAccuracy) {
  const SparseMatrix a = generated({"elasticity", "14"});
  Options o = automatic();
  o.refinement_steps = 1;
  o.required_backward_error = 1e-15;
  const Outcome r = run(a, o);
  EXPECT_TRUE(r.solve.status.ok()) << r.solve.status.message;
  EXPECT_LE(r.error, 1e-15);
  EXPECT_EQ(r.precision, Precision::fp64);
  EXPECT_TRUE(says(r, "a backward error of")) << "the log tells why";
  o.precision = Precision::mixed;
  EXPECT_EQ(run(a, o).solve.status.code, StatusCode::accuracy_not_reached) << "else this test shows nothing";
}

// From a condition of 1e2 to 1e9, and singular: status, rank, inertia and backward error as those of FP64.
TEST(Precision, NothingThatFp64SolvesIsAnsweredWorse) {
  const std::vector<std::string> systems[] = {{"poisson", "8"},
                                              {"elasticity", "6"},
                                              {"elasticity", "30", "2", "2"},
                                              {"plate", "24"},
                                              {"gyroscopic", "6"},
                                              {"kkt", "3", "4", "3", "3"},
                                              {"kkt-redundant", "2", "2", "4", "3", "3"}};
  int in_fp32 = 0;
  for (const auto& words : systems) {
    const SparseMatrix a = generated(words);
    const std::vector<double> b = reference::random_vector(a.rows, 3);
    FactorResult truth;
    for (const Precision precision : {Precision::fp64, Precision::mixed, Precision::automatic}) {
      SCOPED_TRACE(words[0] + " " + words[1] + ", precision " + std::to_string(static_cast<int>(precision)));
      Options o;
      o.device = "cpu";
      o.threads = 1;
      o.precision = precision;
      o.machine = "host.single=100";
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      const FactorResult f = s.factorize(a);
      if (precision == Precision::fp64) truth = f;
      EXPECT_EQ(f.status.code, truth.status.code) << f.status.message;
      EXPECT_EQ(f.rank, truth.rank);
      EXPECT_EQ(f.inertia.positive, truth.inertia.positive);
      EXPECT_EQ(f.inertia.negative, truth.inertia.negative);
      EXPECT_EQ(f.inertia.zero, truth.inertia.zero);
      if (!f.status.ok()) continue;
      in_fp32 += f.precision == Precision::mixed ? 1 : 0;
      std::vector<double> x(b.size());
      EXPECT_TRUE(s.solve(b, x).status.ok());
      EXPECT_LE(matrix::backward_errors(a, x, b, 1, Transpose::no, nullptr).normwise, 2 * kEps);
    }
  }
  EXPECT_GE(in_fp32, 4) << "else FP32 was hardly asked";
}

TEST(Precision, TwoSlowFactorsInARowEndIt) {
  SolveResult slow;
  slow.seconds = 1;
  slow.solve_seconds = 0.1;
  slow.refinement_steps = 7;  // 8 passes of 0.125; in FP64 two of 0.225
  solver::PrecisionWatch watch(2);
  EXPECT_FALSE(watch.next_factor()) << "nothing is known";
  watch.add_factorization(1);  // 2 in FP64
  watch.add_solve(slow);
  EXPECT_DOUBLE_EQ(watch.seconds(), 2);
  EXPECT_DOUBLE_EQ(watch.seconds_in_fp64(), 2.45);
  EXPECT_FALSE(watch.next_factor());
  for (int k = 0; k < 2; ++k) {
    watch.add_factorization(1);
    watch.add_solve(slow);
    watch.add_solve(slow);  // 3 against 2.9
    EXPECT_EQ(watch.next_factor(), k == 1);
  }
  watch.add_factorization(1);
  EXPECT_FALSE(watch.next_factor()) << "a factor without solves tells nothing";
}

}  // namespace precision_test
}  // namespace espalier
