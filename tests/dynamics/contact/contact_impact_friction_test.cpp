// Impulses with friction. Truth: the conditions of the law, energy, closed forms of a ball with spin, a block that
// lands sliding, and a rod whose end is caught.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "dynamics/contact/impact_friction.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_impact_friction_test {

constexpr double kGravity = 9.81;
const std::string kFloor = "[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n";

// ---- The law alone

/// Points on a body with `freedoms` coordinates: fewer than rates make w singular, as the corners of a block do.
contact::FrictionImpact any_impact(std::mt19937& engine, int points, int freedoms, double restitution) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const Eigen::MatrixXd by = Eigen::MatrixXd::NullaryExpr(3 * points, freedoms, [&] { return uniform(engine); });
  const Eigen::VectorXd v = Eigen::VectorXd::NullaryExpr(freedoms, [&] { return uniform(engine); });
  return {by * by.transpose(), by * v, Eigen::VectorXd::Constant(points, restitution),
          Eigen::VectorXd::NullaryExpr(points, [&] { return 0.5 * (1 + uniform(engine)); })};
}

TEST(ContactImpactFriction, LawHoldsAndEnergyDoesNotGrow) {
  constexpr int kCases = 200;
  int sticking = 0, slipping = 0, lifted = 0, kept = 0, lowered = 0;
  for (unsigned seed = 0; seed < kCases; ++seed) {
    std::mt19937 engine(seed);
    const int points = 1 + static_cast<int>(seed % 4);
    const double restitution = seed % 3 == 0 ? 0.7 : 0;
    const contact::FrictionImpact in = any_impact(engine, points, 6, restitution);
    const Eigen::VectorXd p = contact::friction_impulses(in), u = in.before + in.w * p;
    const double speed = in.before.cwiseAbs().maxCoeff(), tight = 1e-8 * speed;
    EXPECT_LE(p.dot(in.before + 0.5 * in.w * p), 1e-11 * speed * p.cwiseAbs().sum()) << "seed " << seed;
    for (Eigen::Index i = 0; i < points; ++i) {
      const Eigen::Vector2d t = p.segment<2>(3 * i + 1), slip = u.segment<2>(3 * i + 1);
      const double limit = in.friction[i] * p[3 * i];
      EXPECT_GE(p[3 * i], 0);
      EXPECT_LE(t.norm(), limit * (1 + 1e-14)) << "seed " << seed;
      if (restitution > 0) {
        const double parts = -restitution * std::min(0.0, in.before[3 * i]);
        if (p[3 * i] > 0 && parts > 0) ++(std::abs(u[3 * i] - parts) < tight ? kept : lowered);
        continue;
      }
      EXPECT_GT(u[3 * i], -tight) << "seed " << seed;
      EXPECT_LT(p[3 * i] * std::abs(u[3 * i]), 1e-7 * speed * (1 + p[3 * i])) << "seed " << seed;
      if (p[3 * i] == 0) ++lifted;
      if (t.norm() < limit * (1 - 1e-6)) {
        EXPECT_LT(slip.norm(), 1e-6 * speed) << "seed " << seed;
        ++sticking;
      } else if (limit > 0) {
        EXPECT_NEAR(t.dot(slip), -t.norm() * slip.norm(), 1e-6 * limit * speed) << "seed " << seed;
        ++slipping;
      }
    }
  }
  EXPECT_GT(sticking, 15);
  EXPECT_GT(slipping, 30);
  EXPECT_GT(lifted, 30);
  EXPECT_GT(kept, 30);
  EXPECT_GT(lowered, 1);
}

// ---- Bodies

Simulation after(const std::string& bodies, const std::string& names, double restitution, double friction, double end) {
  return simulated(fmt::format(
      "gravity = [0, 0, -{}]\n{}{}[contacts.c]\nsurfaces = [{}]\nlaw = \"impulse\"\nstiffness = 1e7\nrestitution = {}\n"
      "friction = {}\ntangential_damping = 2e3\n[integrator]\nend = {:.17g}\nrelative = 1e-9\nabsolute = 1e-9\n",
      kGravity, bodies, kFloor, names, restitution, friction, end));
}

// The slip at the floor ends or is fought by mu P, P = (1 + e) m v_n:  dv = T / m, dw = r T / J across.
TEST(ContactImpactFriction, BallWithSpinBounces) {
  constexpr double kRadius = 0.1, kMass = 2, kInertia = 0.4 * kMass * kRadius * kRadius, kDown = 3, kAlong = 1,
                   kE = 0.8;
  int stuck = 0;
  for (const double spin : {-40.0, 0.0, 10.0, 60.0})  // about y; 10 rolls along x
    for (const double friction : {0.02, 0.2, 1.0}) {
      const double end = 1e-3, fall = kDown * end / 2;
      const std::string ball = fmt::format(
          "[bodies.ball]\ntype = \"rigid\"\nmass = {0}\ninertia = [{1:.17g}, {1:.17g}, {1:.17g}]\nposition = [0, 0, "
          "{2:.17g}]\nvelocity = [{3}, 0, -{4}]\nangular_velocity = [0, {5}, 7]\n[surfaces.ball]\nbody = \"ball\"\n"
          "shape = \"sphere\"\nradius = {6}\n",
          kMass, kInertia, kRadius + fall, kAlong, kDown, spin, kRadius);
      const Simulation run = after(ball, "\"floor\", \"ball\"", kE, friction, end);
      ASSERT_EQ(run.value("c.impacts"), 1);
      const double down = std::sqrt(kDown * kDown + 2 * kGravity * fall), push = (1 + kE) * kMass * down;
      const double slip = kAlong - kRadius * spin, stop = -slip / (1 / kMass + kRadius * kRadius / kInertia);
      const double t = std::clamp(stop, -friction * push, friction * push);
      stuck += t == stop && slip != 0 ? 1 : 0;
      EXPECT_NEAR(run.value("c.impulse"), push, 1e-7 * push);
      EXPECT_NEAR(run.value("ball.velocity.x"), kAlong + t / kMass, 1e-7) << spin << ' ' << friction;
      EXPECT_NEAR(run.value("ball.angular_velocity.y"), spin - kRadius * t / kInertia, 1e-5) << spin << ' ' << friction;
      EXPECT_NEAR(run.value("ball.angular_velocity.z"), 7, 1e-9);  // no moment about the normal
    }
  EXPECT_EQ(stuck, 4);
}

// It keeps v - mu v_n along the floor, does not tip, and slides on until mu g has stopped it.
TEST(ContactImpactFriction, BlockLandsSliding) {
  constexpr double kFriction = 0.3, kAlong = 1.5, kDrop = 0.05;
  const std::string block = fmt::format(
      "[bodies.block]\ntype = \"rigid\"\nmass = 2\nbox = [0.4, 0.3, 0.1]\nposition = [0, 0, {:.17g}]\nvelocity = [{}, "
      "0, "
      "0]\n[surfaces.block]\nbody = \"block\"\nshape = \"box\"\nsize = [0.4, 0.3, 0.1]\n",
      0.05 + kDrop, kAlong);
  const double time = std::sqrt(2 * kDrop / kGravity), down = kGravity * time, left = kAlong - kFriction * down;
  const Simulation landed = after(block, "\"floor\", \"block\"", 0, kFriction, time + 1e-5);
  EXPECT_NEAR(landed.value("block.velocity.x"), left, 1e-4 * left);
  EXPECT_NEAR(landed.value("block.angular_velocity.norm"), 0, 1e-3);
  EXPECT_NEAR(landed.value("c.impulse"), 2 * down, 1e-6 * down);
  const double stop = left / (kFriction * kGravity), way = kAlong * time + 0.5 * left * stop;
  const Simulation rests = after(block, "\"floor\", \"block\"", 0, kFriction, time + stop + 0.1);
  EXPECT_NEAR(rests.value("block.position.x"), way, 2e-3 * way);
  EXPECT_NEAR(rests.value("block.velocity.norm"), 0, 1e-4);
}

// The end of a slanting rod is caught: what it turns with about that end is conserved.
TEST(ContactImpactFriction, EndOfARodIsCaught) {
  constexpr double kHalf = 0.5, kMass = 3, kInertia = 0.4, kDown = 2, kAngle = 0.9, kBall = 0.01;
  const double end = 2e-4, x = kHalf * std::cos(kAngle), z = kHalf * std::sin(kAngle);
  const std::string rod = fmt::format(
      "[bodies.rod]\ntype = \"rigid\"\nmass = {}\ninertia = [{}, {}, {}]\nposition = [0, 0, {:.17g}]\nvelocity = [0, "
      "0, "
      "-{}]\n[surfaces.rod]\nbody = \"rod\"\nshape = \"sphere\"\nradius = {}\npoint = [{:.17g}, 0, {:.17g}]\n",
      kMass, kInertia, kInertia, kInertia, z + kBall + kDown * end / 2, kDown, kBall, -x, -z);
  const Simulation run = after(rod, "\"floor\", \"rod\"", 0, 10, end);
  const double down = std::sqrt(kDown * kDown + kGravity * kDown * end), arm_z = z + kBall;
  // About the place of touch, y: m (z v_x - x v_z) + J w; v = w cross arm.
  const double turn = kMass * x * down / (kInertia + kMass * (x * x + arm_z * arm_z));
  EXPECT_NEAR(run.value("rod.angular_velocity.y"), turn, 2e-3 * turn);
  EXPECT_NEAR(run.value("rod.velocity.x"), turn * arm_z, 2e-3 * turn);
  EXPECT_NEAR(run.value("rod.velocity.z"), -turn * x, 4e-3 * turn);
}

}  // namespace contact_impact_friction_test
}  // namespace espalier::dynamics
