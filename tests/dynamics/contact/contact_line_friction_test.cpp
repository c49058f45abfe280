// Lines that rub on each other. Truth: the partial slip of a parabolic pressure, mu N against the slip, rods on an
// inclined track, the capstan equation, symmetry of space. Tangents: contact_solid_test.cpp.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/contact/line_hold.hpp"
#include "dynamics/contact/solid_contact.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_line_friction_test {

constexpr double kFriction = 0.3, kStiffness = 1e6, kTangential = 8e5;

// ---- The spring's hold

TEST(ContactLineHold, ArmTurnsWithTheTangent) {
  contact::LineHold hold;
  hold.arm = {0.3, -0.2, 0.5};
  hold.tangent = Vec3(1, 2, -1).normalized();
  EXPECT_LT((hold.arm_at(3 * hold.tangent) - hold.arm).norm(), 1e-15);
  const Vec3 axis = hold.tangent.unitOrthogonal();
  const Mat3 r = rotation_exp(1.3 * axis);  // the smallest rotation between the two
  EXPECT_LT((hold.arm_at(0.4 * r * hold.tangent) - r * hold.arm).norm(), 1e-15);

  const Vec3 t(0.4, 0.9, 0.7), rate(-0.3, 0.5, 0.2), lever(0.1, 0.6, -0.4);
  const Mat3 by = hold.arm_by(t);
  const contact::LineTurn turn = contact::line_turn(t, rate, lever);
  constexpr double kStep = 1e-5;
  for (int i = 0; i < 3; ++i) {
    const Vec3 d = kStep * Vec3::Unit(i);
    EXPECT_LT(((hold.arm_at(t + d) - hold.arm_at(t - d)) / (2 * kStep) - by.col(i)).norm(), 1e-9);
    const auto gain = [&](const Vec3& dt, const Vec3& dr, const Vec3& dl) {
      return contact::line_turn(t + dt, rate + dr, lever + dl).gain;
    };
    const Vec3 o = Vec3::Zero();
    EXPECT_LT(((gain(d, o, o) - gain(-d, o, o)) / (2 * kStep) - turn.by_tangent.col(i)).norm(), 1e-9);
    EXPECT_LT(((gain(o, d, o) - gain(o, -d, o)) / (2 * kStep) - turn.by_rate.col(i)).norm(), 1e-9);
    EXPECT_LT(((gain(o, o, d) - gain(o, o, -d)) / (2 * kStep) - turn.by_lever.col(i)).norm(), 1e-9);
  }
}

// ---- Rods that are moved by hand

constexpr double kRadius = 0.05, kPressed = 1e-5;  // of each rod, and how far one is pressed into the other

/// A rod along x on top of one that is turned by `angle` about z; both straight.
std::string rods(double angle, double half_length, int elements, int divisions) {
  const auto rod = [&](const char* name, double turn, double z, int parts) {
    return fmt::format(
        "[bodies.{0}]\ntype = \"cable\"\nstart = [{1:.17g}, {2:.17g}, {3:.17g}]\nend = [{4:.17g}, {5:.17g}, "
        "{3:.17g}]\nelements = {6}\naxial = 1e4\nbending = 0.01\nmass_per_length = 0.5\n[surfaces.{0}]\nbody = "
        "\"{0}\"\nshape = \"line\"\nradius = {7}\ndivisions = {8}\n",
        name, -half_length * std::cos(turn), -half_length * std::sin(turn), z, half_length * std::cos(turn),
        half_length * std::sin(turn), elements, kRadius, parts);
  };
  return rod("upper", 0, 2 * kRadius - kPressed, divisions) + rod("lower", angle, 0, 1) +
         fmt::format(
             "[contacts.c]\nsurfaces = [\"upper\", \"lower\"]\nstiffness = {}\nfriction = {}\ntangential_stiffness = "
             "{}\noverlap = 1\n[integrator]\nend = 1\n",
             kStiffness, kFriction, kTangential);
}

struct Rods {
  std::unique_ptr<model::Mechanism> mechanism;
  State state;

  explicit Rods(const std::string& text) : mechanism(built(text)), state(mechanism->system.sizes()) {
    mechanism->system.initial(state.q, state.v);
    mechanism->system.accept(state.view());  // friction begins in the step after the one of the first touch
  }
  contact::Contact& contact() { return *mechanism->surface_contacts.front().parts.front(); }
  /// All of a rod, by positions of its nodes and slopes. @param change  of (position or slope, whether it is a slope)
  template <class Change>
  void move(std::size_t body, const Change& change) {
    const FlexibleBody& flexible = *mechanism->bodies[body].flexible;
    for (Index n = 0; n < flexible.vertices(); ++n) {
      Eigen::Map<Vec3> x(&state.q[static_cast<std::size_t>(flexible.configuration(n))]);
      x = change(Vec3(x), n % 2 == 1);
    }
  }
  void shift(const Vec3& by) {
    move(0, [&](const Vec3& x, bool slope) { return slope ? x : Vec3(x + by); });
  }
  contact::ContactReport report() { return contact().report(state.view()); }
};

/// Force that pulls along the unit vector `e` when the upper rod has gone by `way` in so many steps, and its part
/// across.
struct Pull {
  double along = 0, across = 0, normal = 0;
  double slipping = 0, points = 0;
};
Pull pulled(Rods& rods, const Vec3& e, double way, int steps) {
  for (int k = 0; k < steps; ++k) {
    rods.shift(way / steps * e);
    if (k + 1 < steps) rods.mechanism->system.accept(rods.state.view());
  }
  const contact::ContactReport r = rods.report();
  const Vec3 across = r.force - e * e.dot(r.force) - Vec3::UnitZ() * r.force.z();
  return {r.force.dot(e), across.norm(), r.normal_force, r.slipping, r.points};
}

// The pressure p = p0 (1 - s^2) over the half length a. The spring is stretched by u everywhere and slips where k_t u
// exceeds mu p: T = 2 a (k_t u s + mu p0 (2/3 - s + s^3/3)) with k_t u = mu p0 (1 - s^2).
TEST(ContactLineFriction, CrossedRodsStickPartlyThenSlip) {
  const double a = std::sqrt(2 * 2 * kRadius * kPressed), p0 = kStiffness * kPressed;
  const double largest = kFriction * p0 / kTangential;  // way at which the middle slips, too
  for (const double part : {0.1, 0.5, 0.9}) {
    Rods crossed(rods(std::numbers::pi / 2, 2.5e-3, 4, 40));
    const Pull pull = pulled(crossed, Vec3::UnitY(), part * largest, 3);
    const double s = std::sqrt(1 - part), limit = kFriction * p0;
    const double exact = 2 * a * limit * (part * s + 2.0 / 3 - s + s * s * s / 3);
    EXPECT_NEAR(pull.along, exact, 2e-3 * exact) << part;
    EXPECT_NEAR(pull.normal, 4.0 / 3 * a * p0, 1e-3 * pull.normal);
    EXPECT_GT(pull.slipping, 0);
    EXPECT_LT(pull.slipping, pull.points);
  }
}

TEST(ContactLineFriction, SlidingRodsPullWithMuNAgainstTheSlip) {
  for (const double crossing : {0.5 * std::numbers::pi, 0.25 * std::numbers::pi})
    for (const double direction : {0.0, 0.3, 0.5 * std::numbers::pi, 2.0}) {
      Rods crossed(rods(crossing, 4e-3, 4, 40));
      const Vec3 e(std::cos(direction), std::sin(direction), 0);
      const Pull pull = pulled(crossed, e, 4e-4, 40);
      EXPECT_NEAR(pull.along, kFriction * pull.normal, 1e-3 * kFriction * pull.normal) << crossing << ' ' << direction;
      EXPECT_LT(pull.across, 1e-3 * kFriction * pull.normal) << crossing << ' ' << direction;
    }
}

// Along each other the pressure is even: they stick up to mu N to the last point, and slip beyond; back again.
TEST(ContactLineFriction, ParallelRopesAreExact) {
  Rods ropes(rods(0, 0.2, 4, 1));
  const double length = 0.4, limit = kFriction * kStiffness * kPressed * length;
  const double largest = limit / (kTangential * length);
  const auto pull = [&](double by) {
    const Pull p = pulled(ropes, Vec3::UnitX(), by, 1);
    ropes.mechanism->system.accept(ropes.state.view());
    return p;
  };
  // Within the length where both are.
  EXPECT_NEAR(pull(0.5 * largest).along, 0.5 * limit, 1e-4 * limit);
  EXPECT_NEAR(pull(0.4 * largest).along, 0.9 * limit, 1e-4 * limit);
  EXPECT_NEAR(pull(0.4 * largest).along, limit, 1e-4 * limit);
  EXPECT_NEAR(pull(-0.5 * largest).along, 0.5 * limit, 1e-4 * limit);
  EXPECT_NEAR(pull(-3 * largest).along, -limit, 1e-4 * limit);
  // What was saved knows the springs.
  std::vector<double> saved;
  ropes.contact().save(saved);
  Rods again(rods(0, 0.2, 4, 1));
  ConstSpan rest = saved;
  again.contact().restore(rest);
  EXPECT_TRUE(rest.empty());
  again.state = ropes.state;
  EXPECT_EQ(again.report().friction_force, ropes.report().friction_force);
  EXPECT_GT(again.report().friction_force, 0.9 * limit);
}

// ---- Symmetry of space

// The spring follows a rotation of everything since the last step, about any axis across the line that holds it.
TEST(ContactLineFriction, RotationOfEverythingMakesNoSlip) {
  for (const Vec3& turn : {Vec3(0.7, 0, 0), Vec3(0, 0, -1.2), Vec3(0.6, 0, 0.8)}) {  // the lower rod lies along y
    Rods here(rods(std::numbers::pi / 2, 2.5e-3, 4, 8)), turned(rods(std::numbers::pi / 2, 2.5e-3, 4, 8));
    const Vec3 by(2e-6, 1.5e-6, 0);
    const Mat3 r = rotation_exp(turn);
    here.shift(by);
    turned.shift(by);
    for (const std::size_t body : {0, 1}) turned.move(body, [&](const Vec3& x, bool) { return Vec3(r * x); });
    for (int again = 0; again < 2; ++again) {  // now, and with what is remembered of it
      const contact::ContactReport a = here.report(), b = turned.report();
      ASSERT_GT(a.friction_force, 0.1 * a.normal_force);
      EXPECT_LT(a.slipping, a.points);
      EXPECT_LT((r * a.force - b.force).norm(), 1e-9 * a.normal_force);
      here.mechanism->system.accept(here.state.view());
      turned.mechanism->system.accept(turned.state.view());
    }
  }
}

// ---- Whole runs

// A rod that lies across two fixed rails, on a slope: it stays as long as tan(slope) < mu, and else slides with the
// acceleration g (sin - mu cos) of a block, along the rails and across them.
double acceleration_of_rod(double slope, bool along_rails, double begin, double end) {
  const double g = 9.81;
  std::string text = fmt::format("gravity = [{:.17g}, {:.17g}, {:.17g}]\n", along_rails ? 0 : g * std::sin(slope),
                                 along_rails ? g * std::sin(slope) : 0, -g * std::cos(slope));
  const std::string beam =
      "[bodies.{0}]\ntype = \"beam\"\nstart = [{1}, {2}, {3}]\nend = [{4}, {5}, {3}]\nelements = {6}\nradius = "
      "0.02\nmaterial = {{ young = 2e9, poisson = 0.3, density = 1000 }}\n{7}[surfaces.{0}]\nbody = \"{0}\"\nshape = "
      "\"line\"\nradius = 0.02\ndivisions = {8}\n";
  for (const double x : {-0.1, 0.1}) {
    const std::string name = x < 0 ? "left" : "right";
    text += fmt::format(fmt::runtime(beam), name, x, -0.06, 0, x, 0.06, 1, "", 1);
    for (const int node : {1, 2})
      text += fmt::format(
          "[joints.{0}{1}]\ntype = \"fixed\"\na = {{ body = \"ground\", point = [{2}, {3}, 0] }}\nb = {{ body = "
          "\"{0}\", node = {1} }}\n",
          name, node, x, node == 1 ? -0.06 : 0.06);
  }
  const double weight = std::numbers::pi * 0.02 * 0.02 * 0.3 * 1000 * g, stiffness = 1e8;
  // Half the weight on each rail is the integral of a parabola: 4/3 k p sqrt(2 (2 r) p).
  const double p = std::pow(0.5 * weight / (4.0 / 3 * stiffness * std::sqrt(0.08)), 2.0 / 3);
  text +=
      fmt::format(fmt::runtime(beam), "rod", -0.15, 0, 0.04 - p, 0.15, 0, 6, "damping = { stiffness = 1e-4 }\n", 24);
  text += fmt::format(
      "[contacts.c]\nsurfaces = [\"rod\"]\nagainst = [\"left\", \"right\"]\nstiffness = {}\nfriction = {}\n"
      "damping = 20\ntangential_damping = 500\noverlap = 1\n"
      "[integrator]\nmethod = \"generalized-alpha\"\nspectral_radius = 0.5\nstep = 1e-3\nend = {}\n",
      stiffness, kFriction, end);
  Simulation run;
  EXPECT_TRUE(run.load_text(text, "rod.toml").ok());
  EXPECT_TRUE(run.step_to(begin).ok());
  const std::string velocity = along_rails ? "rod.velocity.y" : "rod.velocity.x";
  const double before = run.value(velocity);
  EXPECT_TRUE(run.step_to(end).ok());
  return (run.value(velocity) - before) / (end - begin);
}

TEST(ContactLineFriction, RodOnRailsSticksOrSlides) {
  constexpr double kBegin = 0.05, kEnd = 0.15, kGravity = 9.81;
  const double limit = std::atan(kFriction);
  for (const bool along_rails : {true, false}) {
    EXPECT_LT(std::abs(acceleration_of_rod(limit - 0.02, along_rails, kBegin, kEnd)), 1e-3 * kGravity) << along_rails;
    const double slope = limit + 0.2, exact = kGravity * (std::sin(slope) - kFriction * std::cos(slope));
    EXPECT_NEAR(acceleration_of_rod(slope, along_rails, kBegin, kEnd), exact, 1e-2 * exact) << along_rails;
  }
}

// A rope that falls on one that hangs: the bits of a run that was not interrupted.
TEST(ContactLineFriction, RestartsKeepTheBits) {
  const auto rope = [](const char* name, const char* axis) {
    return fmt::format(
        "[bodies.{0}]\ntype = \"cable\"\n{1}\nelements = 6\naxial = 1e4\nbending = 0.01\nmass_per_length = "
        "0.2\n[surfaces.{0}]\nbody = \"{0}\"\nshape = \"line\"\nradius = 0.01\ndivisions = 8\n",
        name, axis);
  };
  const std::string text =
      "gravity = [0, 0, -9.81]\n" + rope("low", "start = [-0.5, 0, 0]\nend = [0.5, 0, 0]") +
      rope("top", "start = [0.02, -0.3, 0.03]\nend = [0.05, 0.5, 0.03]") +
      "[joints.left]\ntype = \"spherical\"\na = { body = \"ground\", point = [-0.5, 0, 0] }\nb = { body = "
      "\"low\", node = 1 }\n[joints.right]\ntype = \"spherical\"\na = { body = \"ground\", point = [0.5, 0, 0] }\nb = "
      "{ "
      "body = \"low\", node = -1 }\n[contacts.c]\nsurfaces = [\"top\", "
      "\"low\"]\nstiffness = 2e5\nfriction = 0.6\ndamping = 2\ntangential_damping = "
      "20\n[integrator]\nmethod = \"generalized-alpha\"\nstep = 1e-3\nend = 0.2\n";
  Simulation whole, rest;
  ASSERT_TRUE(whole.load_text(text, "ropes.toml").ok());
  ASSERT_TRUE(rest.load_text(text, "ropes.toml").ok());
  double rubbed = 0;
  for (double t = 0.06; rubbed == 0 && t < 0.16; t += 0.002) {
    ASSERT_TRUE(whole.step_to(t).ok());
    rubbed = whole.value("c.friction_force");
  }
  ASSERT_GT(rubbed, 0);
  ASSERT_TRUE(rest.restore(whole.save()).ok());
  ASSERT_TRUE(whole.step_to(0.2).ok());
  ASSERT_TRUE(rest.step_to(0.2).ok());
  EXPECT_EQ(whole.save(), rest.save());
}

// A rope over half of a fixed rod whose one end is drawn down: it slides, T2 = T1 exp(mu pi) (Euler and Eytelwein).
double anchor_of_drawn_rope(int elements, double stiffness) {
  constexpr double kRope = 0.05, kWay = 2e-3;
  const std::string beam = R"(axial = 1e4
shear_y = 1e3
shear_z = 1e3
torsion = 1e-3
bending_y = 1e-3
bending_z = 1e-3
section_normal = 1e3
section_shear = 1e3
mass_per_length = 0.01
inertia_y = 1e-5
inertia_z = 1e-5
damping = { mass = 2 }
)";
  const std::string text = fmt::format(
      R"(
[bodies.rope]
type = "beam"
start = [1, 0, 0]
direction = [0, 1, 0]
y = [-1, 0, 0]
length = {0:.17g}
curvature = [0, 0, 1]
elements = {6}
{1}
[bodies.rod]
type = "beam"
start = [0, 0, -0.5]
end = [0, 0, 0.5]
elements = 1
{1}
[joints.low]
type = "fixed"
a = {{ body = "ground", point = [0, 0, -0.5] }}
b = {{ body = "rod", node = 1 }}
[joints.high]
type = "fixed"
a = {{ body = "ground", point = [0, 0, 0.5] }}
b = {{ body = "rod", node = 2 }}
[joints.draw]
type = "prescribed"
a = {{ body = "ground", point = [1, 0, 0] }}
b = {{ body = "rope", node = 1 }}
direction = "y"
motion = "-{2}*t"
[forces.pull]
type = "load"
a = {{ body = "rope", node = -1 }}
force = [0, -1, 0]
[surfaces.rope]
body = "rope"
shape = "line"
radius = {3}
[surfaces.rod]
body = "rod"
shape = "line"
radius = {4}
[contacts.wrap]
surfaces = ["rope", "rod"]
stiffness = {7}
friction = {5}
[integrator]
method = "generalized-alpha"
spectral_radius = 0.3
step = 5e-3
end = 1
)",
      std::numbers::pi, beam, kWay, kRope, 1 - kRope, kFriction, elements, stiffness);
  return std::abs(simulated(text).value("draw.force.y"));
}

TEST(ContactLineFriction, RopeSlidesOverARod) {
  const double exact = std::exp(kFriction * std::numbers::pi);
  EXPECT_NEAR(anchor_of_drawn_rope(16, 1e4), exact, 6e-4 * exact);
  EXPECT_NEAR(anchor_of_drawn_rope(32, 1e5), exact, 6e-5 * exact);
}

}  // namespace contact_line_friction_test
}  // namespace espalier::dynamics
