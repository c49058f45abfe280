// States between two others, as events and switches take them. Truth: the same motion by extrapolation.
#include "dynamics/integrators/interpolation.hpp"

#include <gtest/gtest.h>

#include "dynamics/integrators/step_cases.hpp"

namespace espalier::dynamics {
namespace interpolation_test {

// Largest differences at three tenths of a step.
StepErrors errors_within(double h) {
  const StepCase c = spatial_slider_crank();
  const State a = index_one_truth(*c.system, c.start, c.start.t + 0.01, 1e-3);
  const State b = index_one_truth(*c.system, a, a.t + h, h / 4);
  const State truth = index_one_truth(*c.system, a, a.t + 0.3 * h, h / 4);
  return step_errors(*c.system, between(*c.system, a, b, truth.t), truth);
}

TEST(Interpolation, FallsWithTheStepAsItsDegreesSay) {
  const StepErrors wide = errors_within(8e-3), narrow = errors_within(4e-3);
  EXPECT_LT(wide.lambda, 0.1);
  EXPECT_GT(wide.lambda, 1e-9) << "the multipliers change";
  EXPECT_LT(narrow.q, wide.q / 12);  // cubic: the fourth power
  EXPECT_LT(narrow.v, wide.v / 6);
  EXPECT_LT(narrow.a, wide.a / 3);  // linear: the second
  EXPECT_LT(narrow.lambda, wide.lambda / 3);
}

TEST(Interpolation, EndsAreTheStates) {
  const StepCase c = spatial_slider_crank();
  const State b = index_one_truth(*c.system, c.start, c.start.t + 0.01, 1e-3);
  for (const State* end : {&c.start, &b}) {
    const StepErrors e = step_errors(*c.system, between(*c.system, c.start, b, end->t), *end);
    for (const double error : {e.q, e.v, e.a, e.lambda}) EXPECT_LT(error, 1e-12);
  }
}

}  // namespace interpolation_test
}  // namespace espalier::dynamics
