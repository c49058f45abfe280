// Solves [0; r] by the columns of the constraints. Truth: the factor itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "dynamics/dae/kkt.hpp"

namespace espalier::dynamics {
namespace constraint_response_test {

constexpr Index kMotion = 400, kConstraints = 5;

/// A band of W, five constraints on every coordinate; number 2 is dropped.
class Problem {
 public:
  Problem() : kkt(make_espalier_solver(newton_options(kMotion + kConstraints))) {
    w_ = {kMotion, kMotion, {0}, {}};
    for (Index j = 0; j < kMotion; ++j) {
      for (Index i = std::max<Index>(0, j - 20); i <= std::min<Index>(kMotion - 1, j + 20); ++i) w_.ind.push_back(i);
      w_.ptr.push_back(static_cast<Offset>(w_.ind.size()));
    }
    phi_q_ = {kConstraints, kMotion, {0}, {}};
    for (Index i = 0; i < kConstraints; ++i) {
      for (Index j = 0; j < kMotion; ++j) phi_q_.ind.push_back(j);
      phi_q_.ptr.push_back(static_cast<Offset>(phi_q_.ind.size()));
    }
    kkt.set_pattern(w_, phi_q_);
    kkt.set_dropped({0, 0, 1, 0, 0});
  }
  void factorize(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> number(-1, 1);
    std::size_t k = 0;
    for (Index j = 0; j < kMotion; ++j)
      for (; k < static_cast<std::size_t>(w_.ptr[static_cast<std::size_t>(j) + 1]); ++k)
        kkt.w_values()[k] = number(random) + (w_.ind[k] == j ? 30 : 0);
    for (double& value : kkt.phi_q_values()) value = number(random);
    kkt.factorize();
  }
  /// Solves for a right-hand side and compares with the factor. @return right-hand sides that the factor solved for
  Index solve(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> number(-1, 1);
    std::vector<double> x(kMotion + kConstraints, 0.0);
    for (Index i = 0; i < kConstraints; ++i) x[static_cast<std::size_t>(kMotion + i)] = number(random);
    std::vector<double> truth = x;
    const Index solved = kkt.solve(x, 1, 1);
    kkt.solve(truth, 1);
    double size = 0, error = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      size = std::max(size, std::abs(truth[i]));
      error = std::max(error, std::abs(truth[i] - x[i]));
    }
    EXPECT_GT(size, 1e-3);
    EXPECT_LE(error, 1e-13 * size);
    EXPECT_EQ(x[kMotion + 2], 0);
    return solved;
  }

  KktSolver kkt;

 private:
  SparsePattern w_, phi_q_;
};

constexpr Index kKept = kConstraints - 1;

TEST(ConstraintResponse, ColumnsAreMadeOnceTheyPay) {
  Problem p;
  p.factorize(1);
  for (unsigned k = 0; k < 2; ++k) EXPECT_EQ(p.solve(k), 1);
  EXPECT_EQ(p.solve(10), kKept);
  for (unsigned k = 20; k < 30; ++k) EXPECT_EQ(p.solve(k), 0);
  p.factorize(2);  // columns of another factor; the one before had much to do
  EXPECT_EQ(p.solve(1), kKept);
  EXPECT_EQ(p.solve(2), 0);
  p.factorize(3);
  p.factorize(4);  // the one before had nothing to do
  EXPECT_EQ(p.solve(1), 1);
}

TEST(ConstraintResponse, WhatIsForgottenDoesNotDecide) {
  Problem p;
  p.factorize(1);
  for (unsigned k = 0; k < 20; ++k) p.solve(k);
  p.kkt.forget_analysis();
  p.factorize(1);
  EXPECT_EQ(p.solve(1), 1);
}

TEST(ConstraintResponse, OtherRightSidesGoToTheFactor) {
  Problem p;
  p.factorize(5);
  for (unsigned k = 0; k < 10; ++k) p.solve(k);
  std::vector<double> both(2 * (kMotion + kConstraints), 0.0);
  both[3] = 1;                               // a force
  both[2 * kMotion + kConstraints + 4] = 2;  // the last constraint
  std::vector<double> truth = both;
  EXPECT_EQ(p.kkt.solve(both, 2, 1), 1);
  EXPECT_EQ(p.kkt.solve(truth, 2), 2);
  for (std::size_t i = 0; i < both.size(); ++i) EXPECT_NEAR(both[i], truth[i], 1e-13);
}

TEST(ConstraintResponse, SmallFactorsAreLeftAlone) {
  KktSolver kkt(make_dense_solver());
  const SparsePattern w{2, 2, {0, 1, 2}, {0, 1}}, phi_q{1, 2, {0, 2}, {0, 1}};
  kkt.set_pattern(w, phi_q);
  std::fill(kkt.w_values().begin(), kkt.w_values().end(), 1.0);
  std::fill(kkt.phi_q_values().begin(), kkt.phi_q_values().end(), 1.0);
  kkt.factorize();
  for (int k = 0; k < 10; ++k) {
    std::vector<double> x = {0, 0, 2};
    EXPECT_EQ(kkt.solve(x, 1, 1), 1);
    EXPECT_NEAR(x[0], 1, 1e-15);
  }
}

}  // namespace constraint_response_test
}  // namespace espalier::dynamics
