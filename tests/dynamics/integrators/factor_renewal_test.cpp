// When a new factor costs less than the passes that an old one takes in addition: the rule against the best of all
// intervals, and a run against one that has a new factor in every step.
#include "dynamics/integrators/factor_renewal.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/reference/chain.hpp"

namespace espalier::dynamics {
namespace factor_renewal_test {

// Passes of the k-th step (from 0) with a factor.
int passes_at(int k) { return 2 + k / 3; }

// Steps that a factor serves by the rule.
int served(double cost) {
  FactorLife life;
  life.begin();
  for (int k = 0;; ++k)
    if (life.spent_by(passes_at(k), cost)) return k + 1;
}

double average_cost(int steps, double cost) {
  double sum = cost;
  for (int k = 0; k < steps; ++k) sum += passes_at(k);
  return sum / steps;
}

TEST(FactorRenewal, RuleIsWithinAStepOfTheLeastAverageCost) {
  for (const double cost : {1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0}) {
    double best = std::numeric_limits<double>::infinity();
    for (int steps = 1; steps < 200; ++steps) best = std::min(best, average_cost(steps, cost));
    const int steps = served(cost);
    // The step that shows it has been taken already.
    EXPECT_LE(std::min(average_cost(steps, cost), average_cost(std::max(steps - 1, 1), cost)), best * (1 + 1e-12))
        << "cost " << cost << ", " << steps << " steps";
  }
}

TEST(FactorRenewal, CostIsAPowerOfTwoThatGrowsWithTheFactor) {
  NewtonWork work{{1e6, 100, 50'000}, 5'000, 20'000, 60'000, false};
  double before = 0;
  for (int k = 0; k < 12; ++k, work.factor.flops *= 4) {
    const double cost = passes_of_factor(work);
    EXPECT_EQ(cost, std::exp2(std::round(std::log2(cost))));
    EXPECT_GE(cost, before);
    before = cost;
  }
  EXPECT_EQ(before, 64);
  work.on_gpu = true;
  EXPECT_EQ(passes_of_factor(work), 8);
  EXPECT_GE(passes_of_factor({{}, 6, 20, 36, false}), 1);  // dense
}

struct Result {
  State end;
  long factorizations = 0, passes = 0;
};

Result run_chain(std::optional<double> refactor_rate, double newton_tolerance = 0.01, double step = 1e-3) {
  const auto chain = make_chain(10);
  Equations equations(chain->system);
  State start(chain->system.sizes());
  chain->system.initial(start.q, start.v);
  make_consistent(equations, start);
  AlphaOptions options;
  options.step = step;
  options.newton_tolerance = newton_tolerance;
  options.refactor_rate = refactor_rate;
  GeneralizedAlpha integrator(equations, options);
  integrator.start(start);
  const long before = equations.counts().factorizations;
  integrator.integrate(0.1);
  return {integrator.state(), equations.counts().factorizations - before, integrator.counts().newton_iterations};
}

double distance(const Result& a, const Result& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.end.q.size(); ++i) largest = std::max(largest, std::abs(a.end.q[i] - b.end.q[i]));
  return largest;
}

TEST(FactorRenewal, ChainNeedsFewFactorsAndMovesAsWithOneInEachStep) {
  const Result always = run_chain(0), chosen = run_chain(std::nullopt), again = run_chain(std::nullopt);
  EXPECT_GE(always.factorizations, 95);
  EXPECT_LT(chosen.factorizations, always.factorizations / 2);
  EXPECT_GT(chosen.factorizations, 1);
  // Newton may leave a hundredth of the method's own error in a step, which adds up. It falls with the tolerance, as it
  // would not if an old factor left something behind unseen.
  const double error = distance(always, run_chain(0, 0.01, 0.5e-3)), left = distance(always, chosen);
  EXPECT_GT(error, 1e-6);
  EXPECT_LT(left, 0.05 * error);
  EXPECT_LT(distance(run_chain(0, 1e-4), run_chain(std::nullopt, 1e-4)), 0.2 * left);
  EXPECT_EQ(chosen.end.q, again.end.q);
  EXPECT_EQ(chosen.passes, again.passes);
}

}  // namespace factor_renewal_test
}  // namespace espalier::dynamics
