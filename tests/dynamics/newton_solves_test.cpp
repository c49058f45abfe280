// Precision::automatic in Newton's iteration: solves with a factor of FP32 are not refined, but for the first, which
// tells whether the factor serves. Truth: independent residuals.
#include "dynamics/dae/newton_solves.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "dynamics/dae/linear_solver.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"

namespace espalier::dynamics {
namespace {

struct Errors {
  double first, second;
};

// Backward errors of two solves with one factor.
Errors errors_of(const std::vector<std::string>& words) {
  const SparseMatrix a = matrix::generate(matrix::parse_generator(words));
  Options options = newton_options(a.rows, Precision::automatic);
  options.device = "cpu";
  options.machine = "host.single=100";  // FP32, however small the system is
  const auto solver = make_espalier_solver(options);
  EXPECT_TRUE(solver->analyze(a).ok());
  EXPECT_TRUE(solver->factorize(a.values).ok());
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> entry(-1, 1);
  std::vector<double> b(static_cast<std::size_t>(a.rows)), x(b.size());
  for (double& v : b) v = entry(random);
  const auto solved = [&] {
    EXPECT_TRUE(solver->solve(b, x, 1).ok());
    return matrix::backward_errors(a, x, b, 1, Transpose::no, nullptr).normwise;
  };
  const double first = solved();
  return {first, solved()};
}

TEST(NewtonSolves, AFactorOfFp32IsLookedAtOnce) {
  const Errors e = errors_of({"gyroscopic", "12"});
  EXPECT_LE(e.first, NewtonSolves::kMostError);
  EXPECT_LE(e.second, 1e-5);
  EXPECT_GT(e.second, 1e-12) << "the second solve is that of FP32, unrefined";
}

TEST(NewtonSolves, WhereFp32DoesNotServeFp64Does) {
  const Errors e = errors_of({"plate", "40"});
  EXPECT_LE(e.first, 1e-13);
  EXPECT_LE(e.second, 1e-13);
}

}  // namespace
}  // namespace espalier::dynamics
