// Truths: rank by dense full-pivot LU; mechanisms whose redundancies are known; statics and vibrations in closed form.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>

#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/constraints/redundancy.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/forces/frame_force.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/statics/statics.hpp"
#include "dynamics/integrators/vibrations.hpp"
#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics {
namespace constraint_redundancy_test {

TEST(DependentRows, MatchTheDenseRankAndReproduceTheRows) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int trial = 0; trial < 20; ++trial) {
    const Index rows = 12, cols = 15;
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(rows, cols);
    for (Index i = 0; i < rows; ++i) {
      for (int k = 0; k < 4; ++k) a(i, static_cast<Index>(engine() % static_cast<unsigned>(cols))) = uniform(engine);
    }
    const Index dependent = trial % 4;
    for (Index d = 0; d < dependent; ++d) a.row(rows - 1 - 2 * d) = 0.7 * a.row(d) - 1.3 * a.row(d + 2) + 2 * a.row(4);
    SparsePattern p{rows, cols, {0}, {}};
    std::vector<double> values;
    for (Index i = 0; i < rows; ++i) {
      for (Index j = 0; j < cols; ++j) {
        if (a(i, j) == 0) continue;
        p.ind.push_back(j);
        values.push_back(a(i, j));
      }
      p.ptr.push_back(static_cast<Offset>(p.ind.size()));
    }
    const auto found = find_dependent_rows(p, values);
    EXPECT_EQ(static_cast<Index>(found.size()), rows - Eigen::FullPivLU<Eigen::MatrixXd>(a).rank())
        << "trial " << trial;
    for (const DependentRow& d : found) {
      Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(cols);
      for (std::size_t k = 0; k < d.partners.size(); ++k) sum += d.weights[k] * a.row(d.partners[k]);
      EXPECT_LT((sum - a.row(d.row)).cwiseAbs().maxCoeff(), 1e-10) << "trial " << trial;
    }
  }
}

// A door on two hinges on one axis: five constraints too many, all of the second hinge.
struct Door {
  AssembledSystem system;
  RigidBody* leaf = nullptr;
};

std::unique_ptr<Door> make_door(Vec3 error_of_second_hinge) {
  auto door = std::make_unique<Door>();
  RigidBodyData data;
  data.inertia = Vec3(0.3, 0.2, 0.4).asDiagonal();
  data.position = {0.5, 0, 1};
  data.gravity = {0, 0, -9.81};
  data.angular_velocity = {0, 0, 1};
  data.velocity = {0, 0.5, 0};
  door->leaf = &door->system.add(std::make_unique<RigidBody>("leaf", data));
  for (const int k : {1, 2}) {
    const Vec3 place(0, 0, k == 1 ? 0.2 : 1.8);
    const Vec3 error = k == 2 ? error_of_second_hinge : Vec3::Zero();
    door->system.add(revolute_joint("hinge-" + std::to_string(k), std::make_unique<GroundFrame>(place + error),
                                    frame_at(*door->leaf, place)));
  }
  door->system.finish();
  return door;
}

TEST(Redundancy, OfADoorIsNamedDroppedAndWatched) {
  const auto door = make_door(Vec3::Zero());
  Equations equations(door->system);
  State s(door->system.sizes());
  door->system.initial(s.q, s.v);
  RedundancyGuard guard(equations);
  guard.prepare(s);
  ASSERT_EQ(guard.redundant().size(), 5U);
  EXPECT_EQ(guard.degrees_of_freedom(), 1);
  for (const auto& r : guard.redundant()) {
    EXPECT_NE(r.name.find("revolute \"hinge-2\""), std::string::npos) << r.name;
    EXPECT_FALSE(r.partners.empty());
  }
  EXPECT_EQ(guard.redundant().back().name, "revolute \"hinge-2\", rotation about x");
  BdfIntegrator bdf(equations, {});
  bdf.start(s);
  bdf.integrate(1.0);
  guard.check(bdf.state());
  for (const auto& r : guard.redundant()) EXPECT_LT(r.violation, 1e-8) << r.name;
  // Turning at constant rate about a vertical axis: closed form.
  const Quat q = door->leaf->quaternion(bdf.state().q);
  EXPECT_NEAR(2 * std::atan2(q[3], q[0]), 1.0, 1e-5);
  for (const auto& r : guard.redundant()) EXPECT_EQ(bdf.state().lambda[static_cast<std::size_t>(r.row)], 0.0);
}

TEST(Redundancy, ContradictionIsAnErrorThatNamesThePair) {
  const auto door = make_door({0, 0, 0.01});
  Equations equations(door->system);
  State s(door->system.sizes());
  door->system.initial(s.q, s.v);
  RedundancyGuard guard(equations);
  try {
    guard.prepare(s);
    FAIL() << "no error";
  } catch (const Error& e) {
    const std::string text = e.what();
    EXPECT_NE(text.find("hinge-2"), std::string::npos) << text;
    EXPECT_NE(text.find("hinge-1"), std::string::npos) << text;
    EXPECT_NE(text.find("0.01"), std::string::npos) << text;
  }
}

// Without the guard K is singular; the message names a constraint.
TEST(Redundancy, WithoutTheGuardIsASingularMatrixThatNamesARow) {
  const auto door = make_door(Vec3::Zero());
  Equations equations(door->system);
  State s(door->system.sizes());
  door->system.initial(s.q, s.v);
  EXPECT_THROW(make_consistent(equations, s), Error);
}

// A four-bar laid out straight is singular at the start: what is redundant only there must not be dropped.
TEST(Redundancy, ASingularStartLosesNoConstraint) {
  AssembledSystem system;
  std::vector<RigidBody*> bars;
  RigidBodyData data;
  data.inertia = Vec3(0.01, 0.1, 0.1).asDiagonal();
  const std::array<Vec3, 4> joints = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(3, 0, 0), Vec3(4, 0, 0)};
  for (std::size_t i = 0; i < 3; ++i) {
    data.position = 0.5 * (joints[i] + joints[i + 1]);
    bars.push_back(&system.add(std::make_unique<RigidBody>("bar " + std::to_string(i), data)));
  }
  for (std::size_t i = 0; i < 4; ++i) {
    FramePtr a = std::make_unique<GroundFrame>(joints[i]), b = std::make_unique<GroundFrame>(joints[i]);
    if (i > 0) a = frame_at(*bars[i - 1], joints[i]);
    if (i < 3) b = frame_at(*bars[i], joints[i]);
    system.add(revolute_joint("joint " + std::to_string(i), std::move(a), std::move(b)));
  }
  system.finish();
  Equations equations(system);
  State s(system.sizes());
  system.initial(s.q, s.v);
  RedundancyGuard guard(equations);
  guard.analyze(s);
  // 18 coordinates, 20 equations. In line: rank 16 (the loop can neither lengthen nor... in first order); beside: 17.
  EXPECT_EQ(guard.redundant().size(), 3U);
  EXPECT_EQ(guard.degrees_of_freedom(), 1);
}

TEST(Consistency, ContradictoryVelocitiesAreRefused) {
  AssembledSystem system;
  RigidBodyData data;
  data.position = {1, 0, 0};
  data.velocity = {1, 0, 0};  // along the rod: impossible
  RigidBody& body = system.add(std::make_unique<RigidBody>("rod", data));
  system.add(revolute_joint("pivot", std::make_unique<GroundFrame>(), frame_at(body, Vec3::Zero())));
  system.finish();
  Equations equations(system);
  State s(system.sizes());
  system.initial(s.q, s.v);
  ConsistencyOptions options;
  options.allowed_velocity = 1e-6;
  EXPECT_THROW(make_consistent(equations, s, options), Error);
  State again(system.sizes());
  system.initial(again.q, again.v);
  const ConsistencyResult r = make_consistent(equations, again);
  EXPECT_NEAR(r.velocity_change, 1, 1e-12);
  EXPECT_LT(r.levels.acceleration, 1e-12);
}

TEST(Statics, HangingMassOnABushingAndModes) {
  AssembledSystem system;
  RigidBodyData data;
  data.mass = 2;
  data.inertia = Vec3(0.1, 0.2, 0.3).asDiagonal();
  data.gravity = {0, 0, -9.81};
  RigidBody& body = system.add(std::make_unique<RigidBody>("mass", data));
  BushingLaw law;
  law.stiffness = {100, 200, 300};
  law.angular_stiffness = {10, 20, 30};
  law.damping = {0, 0, 1.5};
  system.add(bushing("mount", std::make_unique<GroundFrame>(), frame_at(body, Vec3::Zero()), law));
  system.finish();
  Equations equations(system);
  State s(system.sizes());
  system.initial(s.q, s.v);
  static_equilibrium(equations, s);
  EXPECT_NEAR(body.position(s.q).z(), -2 * 9.81 / 300, 1e-9);
  // Uncoupled oscillators at the origin of the bushing: omega^2 = k / m, and c / (2 sqrt(k m)) for the damped one.
  // The static deflection couples rotation and translation weakly through the moment arm; compare the vertical one.
  const std::vector<Mode> modes = small_vibrations(equations, s, 6, {}).modes;
  ASSERT_EQ(modes.size(), 6U);
  const double omega = std::sqrt(300.0 / 2), ratio = 1.5 / (2 * std::sqrt(300.0 * 2));
  double nearest = 1e300, damping = 0;
  for (const Mode& m : modes) {
    if (std::abs(std::abs(m.eigenvalue) - omega) < nearest) {
      nearest = std::abs(std::abs(m.eigenvalue) - omega);
      damping = m.damping_ratio;
    }
  }
  EXPECT_LT(nearest, 1e-7 * omega);
  EXPECT_NEAR(damping, ratio, 1e-9);
}

// Physical pendulum: static equilibrium hangs down, frequency sqrt(m g l / (J + m l^2)) / 2 pi.
TEST(Statics, PendulumFindsItsLowestPointAndFrequency) {
  AssembledSystem system;
  RigidBodyData data;
  data.mass = 1.5;
  data.inertia = Vec3(0.02, 0.3, 0.3).asDiagonal();
  data.position = {0.8, -0.3, 0};
  data.gravity = {0, -9.81, 0};
  RigidBody& body = system.add(std::make_unique<RigidBody>("rod", data));
  Joint& joint = system.add(revolute_joint("pivot", std::make_unique<GroundFrame>(), frame_at(body, Vec3::Zero())));
  system.finish();
  Equations equations(system);
  State s(system.sizes());
  system.initial(s.q, s.v);
  static_equilibrium(equations, s);
  const double l = std::hypot(0.8, 0.3);
  EXPECT_NEAR(body.position(s.q).y(), -l, 1e-8);
  EXPECT_NEAR(joint.reaction(s.view(), 1).force.y(), 1.5 * 9.81, 1e-7);
  const std::vector<Mode> modes = small_vibrations(equations, s, 6, {}).modes;
  ASSERT_EQ(modes.size(), 1U);
  const double expected = std::sqrt(1.5 * 9.81 * l / (0.3 + 1.5 * l * l)) / (2 * std::numbers::pi);
  EXPECT_NEAR(modes[0].frequency, expected, 1e-8 * expected);
}

// Gear and rack drive through several turns: the angles must count them.
TEST(Couplings, GearAndRackKeepTheirRatioOverManyTurns) {
  AssembledSystem system;
  RigidBodyData data;
  RigidBody& wheel = system.add(std::make_unique<RigidBody>("wheel", data));
  data.position = {2, 0, 0};
  RigidBody& pinion = system.add(std::make_unique<RigidBody>("pinion", data));
  data.position = {0, 3, 0};
  RigidBody& rack = system.add(std::make_unique<RigidBody>("rack", data));
  const auto ground = [](Vec3 at) { return std::make_unique<GroundFrame>(at); };
  system.add(revolute_joint("a", ground({0, 0, 0}), frame_at(wheel, {0, 0, 0})));
  system.add(revolute_joint("b", ground({2, 0, 0}), frame_at(pinion, {2, 0, 0})));
  system.add(prismatic_joint("c", ground({0, 3, 0}), frame_at(rack, {0, 3, 0})));
  system.add(gear_joint("gear", ground({0, 0, 0}), frame_at(wheel, {0, 0, 0}), ground({2, 0, 0}),
                        frame_at(pinion, {2, 0, 0}), 2.5));
  system.add(rack_and_pinion("rack", ground({2, 0, 0}), frame_at(pinion, {2, 0, 0}), ground({0, 3, 0}),
                             frame_at(rack, {0, 3, 0}), 0.1));
  system.add(
      rotation_motor("motor", ground({0, 0, 0}), frame_at(wheel, {0, 0, 0}), TimeFunction::smooth_step(0, 0, 2, 40)));
  system.finish();
  Equations equations(system);
  State s(system.sizes());
  system.initial(s.q, s.v);
  RedundancyGuard guard(equations);
  guard.prepare(s);
  EXPECT_TRUE(guard.redundant().empty());
  EXPECT_EQ(guard.degrees_of_freedom(), 0);
  BdfIntegrator bdf(equations, {});
  bdf.start(s);
  bdf.integrate(2.5);
  // 40 rad at the wheel: -100 rad at the pinion, -10 m at the rack.
  EXPECT_NEAR(rack.position(bdf.state().q).z(), -10, 1e-7);
}

TEST(PatternChange, IsDetectedAndAnalysedAgain) {
  AssembledSystem system;
  RigidBodyData data;
  RigidBody& one = system.add(std::make_unique<RigidBody>("one", data));
  system.finish();
  Equations equations(system);
  State s(system.sizes());
  system.initial(s.q, s.v);
  make_consistent(equations, s);
  SpringLaw law;
  law.stiffness = 5;
  system.add(spring_damper("late", std::make_unique<GroundFrame>(Vec3(1, 0, 0)), frame_at(one, Vec3::Zero()), law));
  system.finish();
  BdfIntegrator bdf(equations, {});
  bdf.start(s);
  bdf.integrate(0.1);
  EXPECT_EQ(equations.counts().analyses, 2);
  EXPECT_GT(one.position(bdf.state().q).x(), 1e-3);
}

}  // namespace constraint_redundancy_test
}  // namespace espalier::dynamics
