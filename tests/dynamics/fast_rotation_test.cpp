// Generalized-alpha with steps that turn stiff things far: the predictor stretches them.
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/forces/frame_force.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/initial.hpp"

namespace espalier::dynamics {
namespace {

// A mass of 1 kg circles at 1000 rad/s at the end of a spring of 1 m and 1e9 N/m. Truth: the circle of radius r with
// k (r - 1) = m w^2 r. A step of 0.3 rad is predicted some 4e-3 m too far out, where the spring pulls with 4e6 N more
// than the 1e6 N that it has, and the factor of the step before is 0.3 rad off: Newton fails with it.
TEST(FastRotation, GeneralizedAlphaStopsTryingOldFactors) {
  constexpr double kStiffness = 1e9, kRate = 1000, kStep = 3e-4;
  const double radius = 1 / (1 - kRate * kRate / kStiffness);
  AssembledSystem system;
  RigidBodyData data;
  data.position = {radius, 0, 0};
  data.velocity = {0, kRate * radius, 0};
  RigidBody& body = system.add(std::make_unique<RigidBody>("mass", data));
  SpringLaw law;
  law.stiffness = kStiffness;
  law.rest = 1;
  system.add(spring_damper("spring", std::make_unique<GroundFrame>(), std::make_unique<RigidFrame>(body), law));
  system.finish();
  Equations equations(system);
  State s(system.sizes());
  system.initial(s.q, s.v);
  make_consistent(equations, s);
  AlphaOptions options;
  options.step = kStep;
  GeneralizedAlpha alpha(equations, options);
  alpha.start(s);
  alpha.integrate(200 * kStep);
  // Generalized-alpha keeps the circle up to the strain's share of (w h)^2 = 0.09; measured: 4.9e-6.
  EXPECT_NEAR(body.position(alpha.state().q).norm(), radius, 0.09 * 1e-3);
  // One failure for every ten steps that begin with a new factor; 19 measured, 100 if each second step tries the old
  // one.
  EXPECT_LE(alpha.counts().newton_failures, alpha.counts().steps / 10);
}

}  // namespace
}  // namespace espalier::dynamics
