// Generalized-alpha with steps that turn stiff things far: the predictor stretches them.
#include <gtest/gtest.h>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/forces/frame_force.hpp"
#include "dynamics/integrators/generalized_alpha.hpp"
#include "dynamics/integrators/initial.hpp"

namespace espalier::dynamics {
namespace fast_rotation_test {

// A mass of 1 kg circles at 1000 rad/s at the end of a spring of 1 m and 1e9 N/m. Truth: the circle of radius r with
// k (r - 1) = m w^2 r.
class FastRotation : public testing::Test {
 protected:
  static constexpr double kStiffness = 1e9, kRate = 1000;
  const double radius_ = 1 / (1 - kRate * kRate / kStiffness);
  AssembledSystem system_;
  RigidBody* body_ = nullptr;
  std::unique_ptr<Equations> equations_;
  State start_;

  void SetUp() override {
    RigidBodyData data;
    data.position = {radius_, 0, 0};
    data.velocity = {0, kRate * radius_, 0};
    body_ = &system_.add(std::make_unique<RigidBody>("mass", data));
    SpringLaw law;
    law.stiffness = kStiffness;
    law.rest = 1;
    system_.add(spring_damper("spring", std::make_unique<GroundFrame>(), std::make_unique<RigidFrame>(*body_), law));
    system_.finish();
    equations_ = std::make_unique<Equations>(system_);
    start_ = State(system_.sizes());
    system_.initial(start_.q, start_.v);
    make_consistent(*equations_, start_);
  }

  GeneralizedAlpha integrator(double step) {
    AlphaOptions options;
    options.step = step;
    GeneralizedAlpha alpha(*equations_, options);
    alpha.start(start_);
    return alpha;
  }
};

// A step of 0.3 rad is predicted some 4e-3 m too far out, where the spring pulls with 4e6 N more than the 1e6 N that it
// has, and the factor of the step before is 0.3 rad off: Newton fails with it.
TEST_F(FastRotation, GeneralizedAlphaStopsTryingOldFactors) {
  constexpr double kStep = 3e-4;
  GeneralizedAlpha alpha = integrator(kStep);
  alpha.integrate(200 * kStep);
  // Generalized-alpha keeps the circle up to the strain's share of (w h)^2 = 0.09; measured: 4.9e-6.
  EXPECT_NEAR(body_->position(alpha.state().q).norm(), radius_, 0.09 * 1e-3);
  // One failure for every ten steps that begin with a new factor; 19 measured, 100 if each second step tries the old
  // one.
  EXPECT_LE(alpha.counts().newton_failures, alpha.counts().steps / 10);
  EXPECT_EQ(alpha.counts().divisions, 0);
}

// With steps of 0.5 rad Newton fails with new factors too, from the fourth step on. Truth: the same circle.
TEST_F(FastRotation, GeneralizedAlphaDividesStepsInWhichNewtonFails) {
  constexpr double kStep = 5e-4;
  GeneralizedAlpha alpha = integrator(kStep);
  alpha.integrate(200 * kStep);
  const IntegratorCounts& counts = alpha.counts();
  EXPECT_EQ(alpha.state().t, 200 * kStep);
  EXPECT_NEAR(body_->position(alpha.state().q).norm(), radius_, 0.25 * 1e-3);  // measured: 2.2e-5
  EXPECT_GE(counts.divisions, 1);
  EXPECT_EQ(counts.shortest_step, kStep / 2);
  EXPECT_GT(counts.first_division, 0);
  EXPECT_GT(counts.steps, 200);
  // Each return to the long step is twice as far away as the one before.
  EXPECT_LE(counts.divisions, 6);
}

// A run that goes on from saved numbers, in the middle of shorter steps, takes the same steps to the last bit.
TEST_F(FastRotation, ARestartKnowsOfDividedSteps) {
  constexpr double kStep = 5e-4;
  GeneralizedAlpha whole = integrator(kStep);
  whole.integrate(10 * kStep);
  ASSERT_GE(whole.counts().divisions, 1);
  std::vector<double> numbers;
  whole.save(numbers);
  GeneralizedAlpha resumed = integrator(kStep);
  ConstSpan rest = numbers;
  resumed.restore(rest);
  EXPECT_TRUE(rest.empty());
  whole.integrate(60 * kStep);
  resumed.integrate(60 * kStep);
  EXPECT_EQ(whole.state().q, resumed.state().q);
  EXPECT_EQ(whole.counts().steps, resumed.counts().steps);
  EXPECT_EQ(whole.counts().divisions, resumed.counts().divisions);
}

}  // namespace fast_rotation_test
}  // namespace espalier::dynamics
