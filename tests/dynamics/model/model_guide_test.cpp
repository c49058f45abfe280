// Contact with a guide. Truth: geometry of straight lines and circles, central differences, Newton's laws.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/check.hpp"
#include "dynamics/forces/guide.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

GuidePath quarter() {
  GuidePath path({-2, 0, 0}, 0);
  path.add(2, 0);
  path.add(0.5 * std::numbers::pi * 3, -1.0 / 3);  // to the right about (0, -3)
  path.add(1, 0);
  return path;
}

TEST(ModelGuide, PathAndDistance) {
  const GuidePath path = quarter();
  EXPECT_NEAR((path.point(path.length()) - Vec3(3, -4, 0)).norm(), 0, 1e-14);
  EXPECT_NEAR(path.nearest({-1, 0.25, 7}).distance, 0.25, 1e-15);
  EXPECT_NEAR(path.nearest({-9, -0.5, 0}).distance, -0.5, 1e-15);  // before the beginning: straight on
  EXPECT_NEAR(path.nearest({3.2, -50, 0}).distance, 0.2, 1e-13);   // behind the end
  const Vec3 direction(std::sin(0.6), std::cos(0.6), 0);
  const auto arc = path.nearest(Vec3(0, -3, 0) + 3.1 * direction);
  EXPECT_NEAR(arc.distance, 0.1, 1e-14);
  EXPECT_NEAR(arc.normal.dot(direction), 1, 1e-14);
  EXPECT_NEAR(arc.tangent.dot(Vec3(std::cos(0.6), -std::sin(0.6), 0)), 1, 1e-14);
  EXPECT_EQ(arc.curvature, -1.0 / 3);
}

TEST(ModelGuide, DerivativesAgreeWithDifferences) {
  for (const bool both : {false, true})
    for (const Vec3& place : {Vec3(-1, -0.9, 0.4), Vec3(1.5, -1.6, 0.2)}) {  // on the straight piece, on the arc; below
      AssembledSystem system;
      RigidBodyData data;
      data.mass = 2;
      data.inertia = Vec3(0.5, 0.7, 0.9).asDiagonal();
      data.rotation = quaternion_exp({0.1, -0.2, 0.15});
      auto& a = system.add(std::make_unique<RigidBody>("a", data));
      data.position = place;
      auto& b = system.add(std::make_unique<RigidBody>("b", data));
      GuideLaw law;
      law.path = quarter();
      law.stiffness = 10;
      law.damping = 0.7;
      law.friction = 0.3;
      law.slip_speed = 0.8;
      law.smoothing = 0.9;
      law.both_sides = both;
      auto& force = system.add(guide("guide", std::make_unique<RigidFrame>(a, Vec3(0.1, 0, 0.2)),
                                     std::make_unique<RigidFrame>(b, Vec3(0, 0.1, 0.05)), law));
      system.finish();
      State s(system.sizes());
      system.initial(s.q, s.v);
      for (std::size_t i = 0; i < s.v.size(); ++i) s.v[i] = std::sin(1.7 * static_cast<double>(i + 1));
      ASSERT_GT(force.applied(s.view(), 1).force.norm(), 0.1);  // in contact
      // Central differences: as in jacobian_test.cpp.
      EXPECT_LT(check_jacobians(system, s).largest(), 2e-8) << check_jacobians(system, s).worst;
    }
}

TEST(ModelGuide, AMassSlidesDownAnInclineWithFriction) {
  // Incline of 30 degrees, friction 0.2 fully developed: a = g (sin 30 - 0.2 cos 30).
  const Simulation s = simulated(R"(gravity = [0, -10, 0]
[bodies.slider]
type = "rigid"
mass = 0.5
box = [0.1, 0.1, 0.1]
[forces.incline]
type = "guide"
a = { body = "ground" }
b = { body = "slider" }
direction = "-pi/6"
lengths = [1]
curvatures = [0]
stiffness = 1e5
damping = 200
smoothing = 1e-6
friction = 0.2
slip_speed = 1e-4
[integrator]
relative = 1e-7
absolute = 1e-8
end = 1
)");
  const double acceleration = 10 * (0.5 - 0.2 * std::sqrt(0.75));
  // Friction lags by tanh until slip >> slip_speed, in the first 1e-4 s, and while contact builds up (1 ms).
  EXPECT_NEAR(s.value("slider.velocity.norm"), acceleration, 0.01 * acceleration);
  EXPECT_NEAR(s.value("incline.force.norm"), 0.5 * 10 * std::sqrt(0.75) * std::hypot(1, 0.2), 1e-3);
}

}  // namespace
}  // namespace espalier::dynamics
