// Frequency responses of models: closed forms of masses, pendulums and beams; loads of all sorts; quantities; files.
#include <fmt/format.h>

#include "dynamics/model/model_common.hpp"
#include "dynamics/model/model_harmonic_common.hpp"

namespace espalier::dynamics {
namespace {

using test::Complex;
using test::kI;
using test::kTwoPi;
using test::responded;
using test::value_of;

// A mass on a rail along z, on a spring with a damper, in equilibrium with its weight. Truth: 5 / (k + i w c - w^2 m).
constexpr const char* kMassOnARail = R"(
gravity = [0, 0, -9.81]
[bodies.bob]
type = "rigid"
mass = 2
inertia = [1, 1, 1]
position = [0, 0, 1]
[joints.rail]
type = "prismatic"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "bob", axis = [0, 0, 1] }
[forces.spring]
type = "spring"
a = { body = "ground" }
b = { body = "bob" }
stiffness = 800
damping = 3
rest = 1
[forces.shaker]
type = "load"
a = { body = "bob" }
force = [0, 0, 5]
factor = 0
[initial]
statics = true
)";

TEST(ModelHarmonic, AMassOnASpringIsItsClosedForm) {
  for (const double eta : {0.0, 0.1}) {
    const ModelHarmonicResult r = responded(
        std::string(kMassOnARail) +
        "[harmonic]\nfrom = 0\nto = 6\npoints = 13\nloads = [\"shaker\"]\nloss_factor = " + fmt::format("{:f}", eta) +
        "\nquantities = [\"bob.position.z\", \"bob.velocity.z\", \"bob.acceleration.z\", \"spring.force.z\", "
        "\"shaker.force.z\", \"bob.position.x\", \"energy.kinetic\"]\n");
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    ASSERT_EQ(r.response.points.size(), 13U);
    EXPECT_EQ(r.loads, std::vector<std::string>{"shaker"});
    for (std::size_t p = 0; p < r.response.points.size(); ++p) {
      const double w = kTwoPi * r.response.points[p].frequency;
      const Complex x = 5.0 / (800.0 * Complex(1, eta) + kI * w * 3.0 - 2 * w * w);
      const auto near = [&](const char* name, Complex truth) {
        EXPECT_LE(std::abs(value_of(r, p, name) - truth), 1e-10 * std::abs(truth)) << name << " " << w;
      };
      near("bob.position.z", x);
      near("bob.velocity.z", kI * w * x);
      near("bob.acceleration.z", -w * w * x);
      // What the spring's law itself says of the motion: a loss factor is no part of the law.
      near("spring.force.z", -(800.0 + kI * w * 3.0) * x);
      near("shaker.force.z", 5);
      EXPECT_LE(std::abs(value_of(r, p, "bob.position.x")), 1e-14);
      EXPECT_LE(std::abs(value_of(r, p, "energy.kinetic")), 1e-12);  // of second order
    }
  }
}

// Two points and a spring, free in space: singular at frequency 0 alone, where the sweep begins. Truth: half of the
// force over the spring's reduced mass moves them apart, half moves them together.
TEST(ModelHarmonic, FreeBodiesFromFrequencyZero) {
  const std::string text = R"(
[bodies.one]
type = "point"
mass = 2
position = [0, 0, 0]
[bodies.two]
type = "point"
mass = 2
position = [1, 0, 0]
[forces.spring]
type = "spring"
a = { body = "one" }
b = { body = "two" }
stiffness = 800
damping = 1
rest = 1
[forces.shaker]
type = "load"
a = { body = "two" }
force = [1, 0, 0]
factor = 0
[harmonic]
to = 10
tolerance = 1e-4
loads = ["shaker"]
quantities = ["two.position.x"]
)";
  const ModelHarmonicResult r = responded(text);
  EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::singular)) << r.status.message;
  ASSERT_GE(r.response.points.size(), 101U);
  EXPECT_FALSE(r.response.points[0].status.ok());
  for (std::size_t p = 1; p < r.response.points.size(); ++p) {
    const double w = kTwoPi * r.response.points[p].frequency;
    const Complex x = 0.25 * (1.0 / Complex(-w * w) + 1.0 / (800.0 + kI * w * 1.0 - w * w));
    EXPECT_LE(std::abs(value_of(r, p, "two.position.x") - x), 1e-2 * std::max(std::abs(x), 1e-6)) << w;
  }
}

// The same by a motor: the base moves by u. Truth: bob (k + i w c) u / (k + i w c - w^2 m); the motor carries all.
TEST(ModelHarmonic, APrescribedMotionMovesTheBase) {
  for (const double eta : {0.0, 0.05}) {
    const ModelHarmonicResult r = responded(R"(
[bodies.base]
type = "rigid"
mass = 1
inertia = [1, 1, 1]
[bodies.bob]
type = "rigid"
mass = 2
inertia = [1, 1, 1]
position = [0, 0, 1]
[joints.guide]
type = "prismatic"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "base", axis = [0, 0, 1] }
[joints.rail]
type = "prismatic"
a = { body = "base", axis = [0, 0, 1] }
b = { body = "bob", axis = [0, 0, 1] }
[joints.table]
type = "translation-motor"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "base", axis = [0, 0, 1] }
motion = "0"
[forces.spring]
type = "spring"
a = { body = "base" }
b = { body = "bob" }
stiffness = 800
damping = 3
rest = 1
[harmonic]
from = 0.5
to = 6
points = 12
loads = { shake = { table = { amplitude = 0.01, phase = 90 } } }
quantities = ["bob.position.z", "base.position.z", "table.force.z"]
loss_factor = )" + fmt::format("{:f}", eta));
    ASSERT_TRUE(r.status.ok()) << r.status.message;
    for (std::size_t p = 0; p < r.response.points.size(); ++p) {
      const double w = kTwoPi * r.response.points[p].frequency;
      const Complex u = 0.01 * kI, k = 800.0 * Complex(1, eta) + kI * w * 3.0, x = k * u / (k - 2 * w * w);
      EXPECT_LE(std::abs(value_of(r, p, "base.position.z") - u), 1e-12 * std::abs(u));
      EXPECT_LE(std::abs(value_of(r, p, "bob.position.z") - x), 1e-10 * std::abs(x)) << w;
      const Complex force = -w * w * (u + 2.0 * x);  // on both masses
      EXPECT_LE(std::abs(value_of(r, p, "table.force.z") - force), 1e-9 * std::abs(force)) << w;
    }
  }
}

// A pendulum in equilibrium: gravity alone holds it, through the reaction of its hinge. Truth at distance l:
// x = F / (m g / l - w^2 (m + J / l^2)), and the hinge gives the bob what its acceleration lacks, -m w^2 x - F.
TEST(ModelHarmonic, APendulumSwingsAboutItsEquilibrium) {
  const ModelHarmonicResult r = responded(R"(
gravity = [0, 0, -10]
[bodies.bob]
type = "rigid"
mass = 2
inertia = [1e-9, 1e-9, 1e-9]
position = [0, 0, -0.4]
[joints.hinge]
type = "revolute"
a = { body = "ground", axis = [0, 1, 0] }
b = { body = "bob", point = [0, 0, 0.4], axis = [0, 1, 0] }
[forces.push]
type = "load"
a = { body = "bob" }
force = [1, 0, 0]
factor = 0
[statics]
[harmonic]
frequencies = [0, 0.3, 0.6, 1.1, 2, 5]
loads = ["push"]
quantities = ["bob.position.x", "bob.position.z", "hinge.force.x", "hinge.angle"]
)");
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  ASSERT_EQ(r.response.points.size(), 6U);
  for (std::size_t p = 0; p < 6; ++p) {
    const double w = kTwoPi * r.response.points[p].frequency;
    const double x = 1 / (2 * 10 / 0.4 - w * w * (2 + 1e-9 / 0.16));
    EXPECT_NEAR(value_of(r, p, "bob.position.x").real() / x, 1, 1e-8) << w;
    EXPECT_LE(std::abs(value_of(r, p, "bob.position.x").imag()), 1e-12);
    EXPECT_LE(std::abs(value_of(r, p, "bob.position.z")), 1e-9 * std::abs(x));
    EXPECT_NEAR(value_of(r, p, "hinge.force.x").real() / (-2 * w * w * x - 1), 1, 1e-8) << w;
    EXPECT_NEAR(std::abs(value_of(r, p, "hinge.angle")) / (std::abs(x) / 0.4), 1, 1e-8) << w;
  }
}

// Forces as functions of the state: gyroscopic terms (skew D) and circulatory ones (skew K), two loads, one of them
// turning. Truth: the two equations.
TEST(ModelHarmonic, UnsymmetricStiffnessAndGyroscopicTermsAreKept) {
  const ModelHarmonicResult r = responded(R"(
[parameters]
g = 5
h = 30
[bodies.bob]
type = "point"
mass = 2
[forces.law]
type = "load"
a = { body = "bob" }
force = ["-900*bob.position.x - 4*bob.velocity.x - g*bob.velocity.y - h*bob.position.y", "-700*bob.position.y - 4*bob.velocity.y + g*bob.velocity.x + h*bob.position.x", "-800*bob.position.z"]
[forces.x]
type = "load"
a = { body = "bob" }
force = [1, 0, 0]
factor = 0
[forces.y]
type = "load"
a = { body = "bob" }
force = [0, 1, 0]
factor = 0
[harmonic]
from = 0.1
to = 8
points = 30
quantities = ["bob.position"]
[harmonic.loads]
x = 2
unbalance = { x = 1, y = { phase = -90 } }
)");
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  ASSERT_EQ(r.loads, (std::vector<std::string>{"x", "unbalance"}));
  for (std::size_t p = 0; p < r.response.points.size(); ++p) {
    const double w = kTwoPi * r.response.points[p].frequency;
    Eigen::Matrix2cd z;
    const Complex d = 4.0 * kI * w - 2 * w * w, couple = 30.0 + 5.0 * kI * w;
    z << 900.0 + d, couple, -couple, 700.0 + d;
    const Eigen::Vector2cd x = z.partialPivLu().solve(Eigen::Vector2cd(2, 0)),
                           turning = z.partialPivLu().solve(Eigen::Vector2cd(1, -kI));
    for (Index i = 0; i < 2; ++i) {
      EXPECT_LE(std::abs(r.response.response(p, 0, i) - x[i]), 1e-9 * x.norm()) << w;
      EXPECT_LE(std::abs(r.response.response(p, 1, i) - turning[i]), 1e-9 * turning.norm()) << w;
    }
    EXPECT_LE(std::abs(r.response.response(p, 0, 2)), 1e-12 * x.norm());
  }
}

// What an input drives, by an expression that is not linear; a torque motor; the actuator of a spring; a pressure.
TEST(ModelHarmonic, InputsMotorsActuatorsAndPressuresAreLoads) {
  const ModelHarmonicResult r = responded(R"(
[inputs]
u = 3
[bodies.wheel]
type = "rigid"
mass = 1
inertia = [0.5, 0.5, 0.5]
[joints.axle]
type = "revolute"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "wheel", axis = [0, 0, 1] }
[forces.torsion]
type = "rotational-spring"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "wheel", axis = [0, 0, 1] }
stiffness = 40
damping = 0.3
[forces.engine]
type = "torque-motor"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "wheel", axis = [0, 0, 1] }
torque = "0.1*inputs.u^2 - 0.9"
[harmonic]
from = 0.2
to = 4
points = 9
loads = ["u", "engine", "torsion"]
quantities = ["axle.angle", "engine.strength", "inputs.u"]
)");
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  for (std::size_t p = 0; p < r.response.points.size(); ++p) {
    const double w = kTwoPi * r.response.points[p].frequency;
    const Complex one = 1.0 / (40.0 + 0.3 * kI * w - 0.5 * w * w);
    EXPECT_LE(std::abs(r.response.response(p, 0, 0) - 0.6 * one), 1e-8 * std::abs(one));
    EXPECT_NEAR(r.response.response(p, 0, 1).real(), -0.6, 1e-8);  // positive would pull the angle down
    EXPECT_NEAR(r.response.response(p, 0, 2).real(), 1, 1e-10);
    EXPECT_LE(std::abs(r.response.response(p, 1, 0) - one), 1e-9 * std::abs(one));
    EXPECT_LE(std::abs(r.response.response(p, 2, 0) + one), 1e-9 * std::abs(one));  // positive pulls the angle down
  }
  // A clamped block pressed at its end: the sum of the reactions is that of the inertia and of the pressure.
  const ModelHarmonicResult pressed = responded(R"(
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.1, lz = 0.1, divisions = [4, 1, 1] }
material = { young = 2e9, poisson = 0, density = 1000 }
[joints.clamp]
type = "fixed"
a = { body = "ground" }
b = { body = "block", face = "x0" }
[forces.gas]
type = "pressure"
body = "block"
face = "x1"
pressure = 0
[harmonic]
frequencies = [0, 100]
loads = { gas = 1000 }
quantities = ["clamp.force.x", "block.position.x"]
)");
  ASSERT_TRUE(pressed.status.ok()) << pressed.status.message;
  const double w = kTwoPi * 100;
  for (const std::size_t p : {0U, 1U}) {
    const double inertia = p == 0 ? 0 : -w * w * 10 * value_of(pressed, p, "block.position.x").real();
    // On the block the clamp's force and the pressure's, -10 N, give the mass its acceleration.
    EXPECT_NEAR(value_of(pressed, p, "clamp.force.x").real(), inertia + 10, 1e-5);
  }
  EXPECT_NEAR(value_of(pressed, 0, "block.position.x").real() / (-0.5 * 1000 / 2e9), 1, 1e-3);
}

// A body that nothing holds: -F / (m w^2), and nothing at frequency 0, which says so.
TEST(ModelHarmonic, AFreeBodyFollowsItsMass) {
  const std::string text = R"(
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 0.2, ly = 0.1, lz = 0.1, divisions = [2, 1, 1] }
material = { young = 2e9, poisson = 0.3, density = 1000 }
[markers.middle]
body = "block"
face = "x0"
[forces.push]
type = "load"
a = "middle"
force = [3, 0, 0]
factor = 0
[harmonic]
loads = ["push"]
quantities = ["block.position"]
)";
  const ModelHarmonicResult r = responded(text + "frequencies = [0, 1, 20]\n");
  EXPECT_EQ(r.status.code, StatusCode::singular);
  EXPECT_NE(r.status.message.find("frequency 0 lies on a resonance"), std::string::npos) << r.status.message;
  ASSERT_EQ(r.response.points.size(), 3U);
  EXPECT_TRUE(std::isnan(r.response.response(0, 0, 0).real()));
  for (const std::size_t p : {1U, 2U}) {
    const double w = kTwoPi * r.response.points[p].frequency;
    EXPECT_NEAR(r.response.response(p, 0, 0).real() / (-3 / (2 * w * w)), 1, 1e-6);
    EXPECT_LE(std::abs(r.response.response(p, 0, 1)), 1e-6 * std::abs(r.response.response(p, 0, 0)));
  }
}

TEST(ModelHarmonic, SaysWhatCannotBe) {
  const std::string good = std::string(kMassOnARail) + R"([harmonic]
from = 1
to = 2
points = 3
loads = ["shaker"]
quantities = ["bob.position.z"]
)";
  ASSERT_TRUE(responded(good).status.ok());
  const auto refused = [&](const std::string& what, const std::string& with, const std::vector<std::string>& words,
                           std::vector<std::string> set = {}) {
    std::string text = good;
    if (!what.empty()) {
      ASSERT_NE(text.find(what), std::string::npos) << what;
      text.replace(text.find(what), what.size(), with);
    }
    const Status s = responded(text, set).status;
    EXPECT_EQ(s.code, StatusCode::invalid_input) << with;
    for (const std::string& word : words) EXPECT_NE(s.message.find(word), std::string::npos) << s.message;
  };
  refused("from = 1", "from = -1", {"harmonic.from", "must not be negative"});
  refused("to = 2", "to = 0", {"harmonic.to"});
  refused("to = 2", "to = 0.5", {"harmonic.to", "above 'from'"});
  refused("to = 2", "to = nan", {"harmonic.to", "finite"});
  refused("to = 2\n", "", {"needs 'to'"});
  refused("points = 3", "points = 1", {"harmonic.points"});
  refused("from = 1", "from = 0\nlogarithmic = true", {"equal ratios"});
  refused("points = 3", "frequencies = [1, 2]", {"does not go with 'frequencies'"});
  refused("from = 1\nto = 2\npoints = 3", "frequencies = [2, 1]", {"must rise"});
  refused("from = 1\nto = 2\npoints = 3", "frequencies = []", {"is empty"});
  refused("from = 1\nto = 2\npoints = 3", "frequencies = [-1, 1]", {"not negative"});
  refused("points = 3", "tolerance = 3", {"harmonic.tolerance"});
  refused("points = 3", "tolerance = -1e-3", {"harmonic.tolerance"});
  refused("points = 3", "loss_factor = -1", {"harmonic.loss_factor"});
  refused("points = 3", "max_solves = 2", {"harmonic.max_solves"});
  refused("points = 3", "shapes = [-2]", {"harmonic.shapes"});
  refused("points = 3", "phases = 0", {"harmonic.phases"});
  refused("points = 3", "pionts = 3", {"unknown key", "points"});
  refused("loads = [\"shaker\"]\n", "", {"needs 'loads'"});
  refused("loads = [\"shaker\"]", "loads = []", {"harmonic.loads", "is empty"});
  refused("loads = [\"shaker\"]", "loads = [\"shakr\"]", {"no force, motor or input 'shakr'", "did you mean 'shaker'"});
  refused("loads = [\"shaker\"]", "loads = [\"rail\"]", {"'rail' prescribes no motion"});
  refused("loads = [\"shaker\"]", "loads = [\"shaker\", \"shaker\"]", {"twice"});
  refused("loads = [\"shaker\"]", "loads = { both = {} }", {"is empty"});
  refused("loads = [\"shaker\"]", "loads = { shaker = true }", {"number"});
  refused("loads = [\"shaker\"]", "loads = { shaker = nan }", {"finite"});
  refused("loads = [\"shaker\"]", "loads = { shaker = { amplitude = 1, fase = 3 } }", {"fase"});
  refused("loads = [\"shaker\"]", "loads = { shaker = 0 }", {"acts on nothing"});
  refused("factor = 0", "active = false", {"switched off"});
  refused("force = [0, 0, 5]", "force = [0, 0, 0]", {"acts on nothing"});
  refused("quantities = [\"bob.position.z\"]", "quantities = [\"bab.position.z\"]", {"'bab'"});
  refused("quantities = [\"bob.position.z\"]\n", "", {"names no quantities"});
  refused("quantities = [\"bob.position.z\"]", "quantities = [\"bob.velocity.norm\"]", {"has a kink"});
  refused("[initial]\nstatics = true\n", "[bodies.other]\ntype = \"point\"\nmass = 1\nvelocity = [1, 0, 0]\n",
          {"moves where it is linearised"});
  const Status none = responded(kMassOnARail + std::string("[integrator]\nend = 1\n")).status;
  EXPECT_EQ(none.code, StatusCode::invalid_input);
  EXPECT_NE(none.message.find("no section [harmonic]"), std::string::npos) << none.message;
  EXPECT_EQ(model_harmonic("/nowhere/model.toml").status.code, StatusCode::invalid_input);
}

// Without an equilibrium the response is given, and a notice.
TEST(ModelHarmonic, AStateThatFallsIsANotice) {
  const ModelHarmonicResult r = responded(R"(
gravity = [0, 0, -10]
[bodies.bob]
type = "point"
mass = 2
[forces.push]
type = "load"
a = { body = "bob" }
force = [1, 0, 0]
[harmonic]
frequencies = [1]
loads = ["push"]
quantities = ["bob.position.x"]
)");
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_NEAR(value_of(r, 0, "bob.position.x").real() * -2 * kTwoPi * kTwoPi, 1, 1e-9);
  ASSERT_EQ(r.notices.size(), 1U);
  EXPECT_NE(r.notices[0].find("not in equilibrium"), std::string::npos);
}

// A resonance without damping as exactly as numbers are: the point says so, the others stand.
TEST(ModelHarmonic, AnUndampedResonanceIsSaid) {
  std::string text = kMassOnARail;
  text.erase(text.find("damping = 3"), 11);
  const double resonance = std::sqrt(800.0 / 2) / kTwoPi;
  const ModelHarmonicResult r =
      responded(text + fmt::format("[harmonic]\nfrequencies = [1, {:.17g}, 5]\nloads = [\"shaker\"]\n"
                                   "quantities = [\"bob.position.z\"]\n",
                                   resonance));
  EXPECT_EQ(r.status.code, StatusCode::singular);
  EXPECT_NE(r.status.message.find("resonance without damping"), std::string::npos) << r.status.message;
  ASSERT_EQ(r.response.points.size(), 3U);
  EXPECT_TRUE(std::isnan(r.response.response(1, 0, 0).real()));
  const double w = kTwoPi * 5;
  EXPECT_NEAR(r.response.response(2, 0, 0).real() * (800 - 2 * w * w) / 5, 1, 1e-8);
}

// Quantities of units that are far apart, with a tolerance: within it of the solves at every point.
TEST(ModelHarmonic, AToleranceHoldsForQuantitiesOfAllUnits) {
  const std::string text = test::cantilever(6, 0.02) + R"(loads = ["shaker"]
quantities = ["tip.position", "wall.force.z", "wall.moment.y", "arm.velocity.z"]
from = 3
to = 60
points = 60
)";
  const ModelHarmonicResult exact = responded(text), quick = responded(text + "tolerance = 1e-4\n");
  ASSERT_TRUE(exact.status.ok()) << exact.status.message;
  ASSERT_TRUE(quick.status.ok()) << quick.status.message;
  EXPECT_LT(quick.response.factorizations, 50);
  EXPECT_TRUE(quick.response.complete) << quick.response.completeness;
  EXPECT_EQ(quick.response.resonances.size(), 4U);  // two, each in both directions
  std::size_t q = 0;
  for (std::size_t p = 0; p < exact.response.points.size(); ++p) {
    while (quick.response.points[q].frequency < exact.response.points[p].frequency) ++q;
    ASSERT_EQ(quick.response.points[q].frequency, exact.response.points[p].frequency);
    for (const char* name : {"tip.position.z", "wall.force.z", "wall.moment.y", "arm.velocity.z"})
      EXPECT_LE(std::abs(value_of(quick, q, name) - value_of(exact, p, name)),
                3e-4 * std::abs(value_of(exact, p, name)))
          << name << " " << exact.response.points[p].frequency;
    EXPECT_LE(std::abs(value_of(quick, q, "tip.position.y")), 1e-8 * std::abs(value_of(quick, q, "tip.position.z")));
  }
}

// A run writes the table and the shapes, whether it moves, rests, or does neither; the motion is the same without.
TEST(ModelHarmonic, ARunWritesTableAndShapes) {
  const std::string text = std::string(kMassOnARail) + "[output]\nquantities = [\"bob.position.z\"]\n";
  const std::string harmonic =
      "[harmonic]\nfrom = 1\nto = 5\npoints = 5\nloads = [\"shaker\"]\nshapes = [2, 3.3]\nphases = 4\n";
  for (const char* run : {"", "[integrator]\nend = 0.1\n", "[statics]\n"}) {
    std::string whole = text + run + harmonic;
    if (std::string(run) == "[statics]\n") whole.erase(whole.find("[initial]"), 25);
    const ScratchFolder folder;
    SimulationOptions o;
    o.out = folder.path();
    o.set = {"output.format=vtu"};
    const Simulation s = simulated(whole, o);
    const SimulationSummary& summary = s.summary();
    EXPECT_EQ(summary.harmonic_points, 6);
    ASSERT_EQ(summary.peaks.size(), 1U);
    EXPECT_EQ(summary.peaks[0].quantity, "bob.position.z");
    EXPECT_EQ(summary.peaks[0].load, "shaker");
    EXPECT_EQ(summary.peaks[0].frequency, 3.3);  // the resonance is at 3.18
    const std::string table = content_of(folder.path() + "/harmonic.csv");
    EXPECT_EQ(
        table.substr(0, table.find('\n')),
        "frequency,solved,backward_error,error_estimate,amplitude_bob.position.z_shaker,phase_bob.position.z_shaker");
    EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 7);
    const std::string series = content_of(folder.path() + "/harmonic_shaker.pvd");
    for (const char* time : {"timestep=\"1\"", "timestep=\"1.25\"", "timestep=\"2.75\""})
      EXPECT_NE(series.find(time), std::string::npos) << series;
    if (std::string(run).find("integrator") == std::string::npos) continue;
    const Simulation without = simulated(text + run);
    EXPECT_EQ(s.value("bob.position.z"), without.value("bob.position.z"));
    EXPECT_EQ(summary.steps, without.summary().steps);
  }
}

}  // namespace
}  // namespace espalier::dynamics
