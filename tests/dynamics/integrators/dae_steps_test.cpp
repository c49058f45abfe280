// The public generic layer at small steps and tight tolerances, and its differences.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dynamics/dae/function_system.hpp"
#include "dynamics/integrators/step_cases.hpp"

namespace espalier::dynamics::test {
namespace dae_steps_test {

using Numbers = std::span<const double>;
using Out = std::span<double>;

/// SUNDIALS' slider crank (step_cases.hpp) through the public layer, with differences where nothing is given.
DaeFunctions slider_crank(bool given) {
  DaeFunctions f = sundials_slider_crank_functions();
  if (!given) f.constraint_jacobian = nullptr, f.constraint_gamma = nullptr;
  return f;
}

// Truth: the same motion by another integrator (step_cases.hpp). Newton used to stop at 1e-8 of q: 17.5 for -0.76.
TEST(DaeSteps, GeneralizedAlphaHasRightMultipliersAtSmallSteps) {
  const StepCase c = sundials_slider_crank();
  const State truth = index_one_truth(*c.system, c.start, 1, c.truth);
  for (const bool given : {true, false}) {
    DaeOptions options;
    options.method = DaeMethod::generalized_alpha;
    options.step = 1e-4;
    Dae dae(slider_crank(given), options);
    ASSERT_TRUE(dae.start(0, c.start.q, c.start.v).ok());
    const Status status = dae.integrate(1);
    ASSERT_TRUE(status.ok()) << status.message;
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_NEAR(dae.state().lambda[i], truth.lambda[i], 1e-5) << i;  // rounding: 1e-16 / h^2, magnified
    EXPECT_LT(dae.summary().largest_rounding, given ? 1e-6 : 1e-4);
  }
}

// Truth: as above. Tolerances near rounding, with given derivatives and with differences.
TEST(DaeSteps, TightTolerancesAreNoReasonToGiveUp) {
  const StepCase c = sundials_slider_crank();
  const State truth = index_one_truth(*c.system, c.start, 1, c.truth);
  for (const bool given : {true, false})
    for (const double tolerance : {1e-10, 1e-12, 1e-13}) {
      DaeOptions options;
      options.relative = options.absolute = tolerance;
      Dae dae(slider_crank(given), options);
      ASSERT_TRUE(dae.start(0, c.start.q, c.start.v).ok());
      const Status status = dae.integrate(1);
      ASSERT_TRUE(status.ok()) << tolerance << " " << given << ": " << status.message;
      for (std::size_t i = 0; i < 3; ++i)
        EXPECT_NEAR(dae.state().q[i], truth.q[i], std::max(1e3 * tolerance, 1e-11)) << tolerance << " " << given;
      EXPECT_LT(dae.summary().steps, 20000);
    }
}

// Truth: closed forms; coordinates of 1e-3, 1 and 1e3, and a root that ends a little beside the place.
TEST(DaeSteps, DifferencesOfConstraintsHaveThirteenDigits) {
  DaeFunctions f;
  f.coordinates = 3;
  f.constraints = 3;
  f.mass = [](Numbers, MatrixEntries m) { m(0, 0) = m(1, 1) = m(2, 2) = 1; };
  f.force = [](double, Numbers, Numbers, Out) {};
  f.constraint = [](double, Numbers q, Out phi) {
    phi[0] = std::sin(1000 * q[0]);
    phi[1] = std::exp(q[1]) * std::sqrt(q[1] - 0.4);
    phi[2] = q[2] * q[2] / 1000;
  };
  FunctionSystem system(f);
  const std::vector<double> q = {1e-3, 0.41, 1e3}, v = {1e-3, 0.01, 10};
  std::vector<double> phi_q(9), gamma(3);
  system.constraints(0, q, v, {{}, {}, gamma, phi_q});
  const double root = std::sqrt(0.01), e = std::exp(0.41);
  EXPECT_NEAR(phi_q[0], 1000 * std::cos(1), 1e-8);
  EXPECT_NEAR(phi_q[4], e * (root + 0.5 / root), 1e-11);
  EXPECT_NEAR(phi_q[8], 2, 1e-10);
  EXPECT_EQ(phi_q[1], 0);
  EXPECT_NEAR(gamma[0], std::sin(1), 1e-7);
  EXPECT_NEAR(gamma[1], -1e-4 * e * (root + 1 / root - 0.25 / (root * root * root)), 1e-7);
  EXPECT_NEAR(gamma[2], -0.2, 1e-7);
}

}  // namespace dae_steps_test
}  // namespace espalier::dynamics::test
