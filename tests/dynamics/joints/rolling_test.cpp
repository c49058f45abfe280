// Rolling without slip and skates: non-holonomic constraints. Truth: closed forms (E. J. Routh, "Dynamics of a system
// of rigid bodies", advanced part; J. Neimark, N. Fufaev, "Dynamics of nonholonomic systems", 1972), energy, and the
// other integrators.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"
#include "espalier/sensitivities.hpp"

namespace espalier::dynamics {
namespace rolling_test {

constexpr double kPi = std::numbers::pi;

const std::string kBdf = "[integrator]\nrelative = 1e-9\nabsolute = 1e-11\nend = {}\n";

std::string bdf(double end) { return fmt::format(fmt::runtime(kBdf), end); }
std::string alpha(double step, double end) {
  return fmt::format("[integrator]\nmethod = \"generalized-alpha\"\nstep = {}\nend = {}\n", step, end);
}

/// A solid disc of 2 kg and 0.3 m on a plane whose normal is z, its axle y.
std::string disc(const std::string& gravity, const std::string& motion, const std::string& shape = "radius = 0.3") {
  return fmt::format(
      "gravity = {}\n[bodies.disc]\ntype = \"rigid\"\nmass = 2\ninertia = [[0.045, 0, 0], [0, 0.09, 0], [0, 0, "
      "0.045]]\n"
      "{}\n[joints.rolls]\ntype = \"rolling\"\na = {{ body = \"ground\", axis = [0, 0, 1] }}\n"
      "b = {{ body = \"disc\", axis = [0, 1, 0] }}\n{}\n",
      gravity, motion, shape);
}

TEST(Rolling, DiscRunsDownAnIncline) {
  const std::string model = disc("[3, 0, -9]", "position = [0, 0, 0.3]");
  const auto check = [](Simulation& run, double tolerance) {
    EXPECT_NEAR(run.value("disc.position.x"), 4, tolerance);  // g sin / (1 + 1/2) t^2 / 2
    EXPECT_NEAR(run.value("disc.position.y"), 0, 1e-9);
    EXPECT_NEAR(run.value("disc.position.z"), 0.3, 1e-9);
    EXPECT_NEAR(run.value("disc.velocity.x"), 4, tolerance);
    EXPECT_NEAR(run.value("disc.angular_velocity.y"), 4 / 0.3, 4 * tolerance);
    EXPECT_NEAR(run.value("rolls.normal_force"), 18, tolerance);
    EXPECT_NEAR(run.value("rolls.longitudinal_force"), -2, tolerance);  // J / R^2 a against the motion
    EXPECT_NEAR(run.value("rolls.lateral_force"), 0, 1e-8);
    EXPECT_NEAR(run.value("rolls.contact_point.x"), 4, tolerance);
    EXPECT_NEAR(run.value("rolls.contact_point.z"), 0, 1e-9);
  };
  for (const std::string iteration : {"reduced", "full-matched", "full-tangent", "full-boolean"}) {
    Simulation run = simulated(model + bdf(2) + fmt::format("iteration = \"{}\"\n", iteration));
    check(run, 1e-6);
  }
  Simulation run = simulated(model + alpha(1e-2, 2));
  check(run, 1e-7);  // of constant acceleration the method is exact
}

/// Tilted by the angle from upright to the axle's polar angle theta, steadily round with the rate Omega:
///   A Omega^2 sin cos - (C + m a^2) omega_3 Omega sin = m g a cos,
/// A and C moments of inertia about a diameter and the axle, omega_3 the spin about the axle.
TEST(Rolling, WobblingDiscKeepsItsTilt) {
  constexpr double kMass = 2, kRadius = 0.3, kA = 0.045, kC = 0.09, kGravity = 9.81;
  for (const auto& [theta, rate] : {std::pair(1.2, 3.0), {0.6, 14.0}, {2.2, 5.0}, {1.5, -0.4}}) {
    const double s = std::sin(theta), c = std::cos(theta);
    const double spin =
        (kA * rate * rate * s * c - kMass * kGravity * kRadius * c) / ((kC + kMass * kRadius * kRadius) * rate * s);
    // Axle (0, s, c); up along the disc (0, -c, s); velocity of the centre omega x a up along x.
    const double up = rate * s;  // of Omega z along the disc's upward radius
    const auto omega = [&](double axle, double along) { return axle + along; };
    const double wy = omega(spin * s, -up * c), wz = omega(spin * c, up * s), vx = kRadius * (wy * s - wz * -c);
    const std::string motion = fmt::format(
        "position = [0, 0, {:.17g}]\nrotation = [{:.17g}, 0, 0]\nvelocity = [{:.17g}, 0, 0]\nangular_velocity = [0, "
        "{:.17g}, {:.17g}]",
        kRadius * s, kPi / 2 - theta, vx, wy, wz);
    const double end = 2 * kPi / std::abs(rate);
    for (const std::string& integrator : {bdf(end), alpha(end / 800, end)}) {
      Simulation run =
          simulated(disc("[0, 0, -9.81]", motion) + integrator + "[output]\nquantities = [\"rolls.normal_force\"]\n");
      const double tolerance = integrator.find("alpha") == std::string::npos ? 1e-6 : 1e-3;
      EXPECT_NEAR(run.value("disc.position.z"), kRadius * s, tolerance) << theta;
      EXPECT_NEAR(run.value("disc.position.x"), 0, 30 * tolerance) << theta;  // once around
      EXPECT_NEAR(run.value("disc.position.y"), 0, 30 * tolerance) << theta;
      EXPECT_NEAR(run.value("disc.velocity.x"), vx, 20 * tolerance) << theta;
      EXPECT_NEAR(run.value("rolls.normal_force"), kMass * kGravity, 20 * tolerance) << theta;
      // Centripetal: m v^2 / r = m v Omega, inwards.
      EXPECT_NEAR(std::abs(run.value("rolls.lateral_force")), kMass * std::abs(vx * rate), 50 * tolerance) << theta;
    }
  }
}

TEST(Rolling, WobblingDiscKeepsItsEnergy) {
  const std::string motion =
      "position = [0, 0, 0.27]\nrotation = [0.4510268117962624, 0, 0]\nangular_velocity = [1, 4, 2]";
  Simulation run = simulated(disc("[0, 0, -9.81]", motion) + bdf(3));
  const SimulationEnergy begin = run.summary().energy_begin, end = run.summary().energy_end;
  EXPECT_GT(begin.kinetic, 0.1);
  EXPECT_NEAR(end.kinetic + end.potential, begin.kinetic + begin.potential, 1e-6 * begin.kinetic);
  EXPECT_GT(std::abs(end.potential - begin.potential), 1e-3);
  Simulation other = simulated(disc("[0, 0, -9.81]", motion) + alpha(2e-4, 3));
  for (const char* q : {"disc.position.x", "disc.position.y", "disc.position.z"})
    EXPECT_NEAR(other.value(q), run.value(q), 2e-4) << q;
}

/// A tyre's rim moves the plane up by its radius: the same wheel, with r + rim in all but its tilt.
TEST(Rolling, TyreRollsOnItsOutside) {
  Simulation run = simulated(disc("[3, 0, -9]", "position = [0, 0, 0.3]", "radius = 0.3\nrim = 0.1") + bdf(2));
  EXPECT_NEAR(run.value("disc.position.x"), 4, 1e-6);
  EXPECT_NEAR(run.value("rolls.normal_force"), 18, 1e-6);
}

/// On a table that turns with Omega the centre of a solid ball goes round a circle with 2/7 Omega.
TEST(Rolling, BallOnATurntable) {
  constexpr double kOmega = 7;
  const double end = 2 * kPi / (2.0 / 7 * kOmega);
  const auto model = [&](const std::string& integrator) {
    return "gravity = [0, 0, -9.81]\n[bodies.table]\ntype = \"rigid\"\nmass = 5\ninertia = [1, 1, 2]\n"
           "angular_velocity = [0, 0, 7]\n[bodies.ball]\ntype = \"rigid\"\nmass = 0.5\n"
           "inertia = [2e-3, 2e-3, 2e-3]\nposition = [1, 0, 0.1]\nvelocity = [0.2, 0.5, 0]\n"
           "[joints.axle]\ntype = \"revolute\"\nbodies = [\"ground\", \"table\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n"
           "[joints.drive]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"table\"]\nat = [0, 0, 0]\naxis = [0, 0, "
           "1]\nmotion = \"7*t\"\n[joints.rolls]\ntype = \"rolling\"\nshape = \"ball\"\nradius = 0.1\n"
           "a = { body = \"table\", axis = [0, 0, 1] }\nb = { body = \"ball\" }\n" +
           integrator;
  };
  // v turns with 2 rad/s from (0.2, 0.5): half a turn later the ball is across its circle.
  const double way = std::hypot(0.2, 0.5) / (2.0 / 7 * kOmega);
  for (const bool half : {true, false}) {
    const double until = half ? end / 2 : end;
    for (const std::string& integrator : {bdf(until), alpha(until / 1000, until)}) {
      Simulation run = simulated(model(integrator));
      const double tolerance = integrator.find("alpha") == std::string::npos ? 1e-6 : 1e-4;
      // The centre lies to the left of the velocity.
      const double cx = 1 - 0.5 / 2, cy = 0.2 / 2;
      EXPECT_NEAR(run.value("ball.position.x"), half ? 2 * cx - 1 : 1, tolerance);
      EXPECT_NEAR(run.value("ball.position.y"), half ? 2 * cy : 0, tolerance);
      EXPECT_NEAR(std::hypot(run.value("ball.position.x") - cx, run.value("ball.position.y") - cy), way, tolerance);
      EXPECT_NEAR(run.value("ball.position.z"), 0.1, 1e-9);
    }
  }
}

/// Chaplygin's sleigh, thrown with a pure turn W about the skate, centre of mass ahead by a: with J = I + m a^2,
/// U = W (J / m)^1/2 and k = a W^2 / U the skate runs with U tanh k t and turns with W sech k t.
TEST(Rolling, ChaplyginSleigh) {
  constexpr double kMass = 3, kInertia = 0.4, kAhead = 0.5, kTurn = 2;
  const double j = kInertia + kMass * kAhead * kAhead, u = kTurn * std::sqrt(j / kMass), k = kAhead * kTurn * kTurn / u;
  const auto model = [&](const std::string& integrator) {
    return fmt::format(
        "[bodies.sleigh]\ntype = \"rigid\"\nmass = 3\ninertia = [0.4, 0.4, 0.4]\nposition = [0.5, 0, 0]\nvelocity = "
        "[0, "
        "1, 0]\nangular_velocity = [0, 0, 2]\n[joints.plane]\ntype = \"planar\"\nbodies = [\"ground\", \"sleigh\"]\nat "
        "= [0, 0, 0]\naxis = [0, 0, 1]\n[joints.skate]\ntype = \"skate\"\nbodies = [\"ground\", \"sleigh\"]\nat = [0, "
        "0, 0]\naxis = [0, 0, 1]\nx_axis = [1, 0, 0]\n{}",
        integrator);
  };
  constexpr double kEnd = 1.5;
  for (const std::string& integrator : {bdf(kEnd), alpha(1e-3, kEnd)}) {
    Simulation run = simulated(model(integrator));
    const double tolerance = integrator.find("alpha") == std::string::npos ? 1e-7 : 1e-5;
    const double heading = kTurn / k * 2 * std::atan(std::tanh(k * kEnd / 2)), turn = kTurn / std::cosh(k * kEnd);
    EXPECT_NEAR(run.value("sleigh.angular_velocity.z"), turn, tolerance);
    EXPECT_NEAR(run.value("sleigh.rotation.z"), heading, tolerance);
    const double speed = u * std::tanh(k * kEnd);
    EXPECT_NEAR(run.value("sleigh.velocity.x"), speed * std::cos(heading) - kAhead * turn * std::sin(heading),
                2 * tolerance);
    // Sideways force on the skate: the centre's acceleration across, (v w + a w').
    const double force = kMass * (speed * turn - kAhead * kTurn * k * std::tanh(k * kEnd) / std::cosh(k * kEnd));
    EXPECT_NEAR(run.value("skate.lateral_force"), force, 50 * tolerance);
    // The plane holds the height already.
    ASSERT_EQ(run.summary().redundant.size(), 1U);
    EXPECT_NE(run.summary().redundant[0].find("height above the plane"), std::string::npos);
  }
}

std::string axle(const std::string& more, const std::string& integrator) {
  std::string text =
      "gravity = [0, 0, -10]\n[bodies.axle]\ntype = \"rigid\"\nmass = 4\ninertia = [0.5, 0.5, 0.5]\nposition = [0, 0, "
      "0.2]\nvelocity = [1, 0, 0]\nangular_velocity = [0, 0, 0.5]\n";
  for (const auto& [name, y] : {std::pair("left", 0.6), {"right", -0.6}})
    text += fmt::format(
        "[bodies.{0}]\ntype = \"rigid\"\nmass = 1\ninertia = [0.01, 0.02, 0.01]\nposition = [0, {1}, 0.2]\n"
        "[joints.{0}_hub]\ntype = \"revolute\"\nbodies = [\"axle\", \"{0}\"]\nat = [0, {1}, 0.2]\naxis = [0, 1, 0]\n"
        "[joints.{0}_tread]\ntype = \"rolling\"\nradius = 0.2\na = {{ body = \"ground\", axis = [0, 0, 1] }}\n"
        "b = {{ body = \"{0}\", axis = [0, 1, 0] }}\n",
        name, y);
  return text + more + integrator;
}

/// Two wheels on an axle slip sideways together or not at all.
TEST(Rolling, TwoWheelsOnAnAxleShareTheirLateralForce) {
  // The axle may pitch; a skid ahead would be a third wheel. Its weight hangs in the axis: it does not.
  const double end = 2 * kPi / 0.5;
  for (const std::string& integrator : {bdf(end), alpha(end / 2000, end)}) {
    Simulation run = simulated(axle("", integrator));
    const double tolerance = integrator.find("alpha") == std::string::npos ? 1e-6 : 1e-4;
    ASSERT_EQ(run.summary().redundant.size(), 1U);
    EXPECT_NE(run.summary().redundant[0].find("lateral slip"), std::string::npos) << run.summary().redundant[0];
    EXPECT_NE(run.summary().redundant[0].find("right_tread"), std::string::npos) << run.summary().redundant[0];
    EXPECT_EQ(run.summary().degrees_of_freedom, 3);  // ahead, about z, pitch of the axle
    // A circle of radius v / w = 2, left of where it begins.
    EXPECT_NEAR(run.value("axle.position.x"), 0, 10 * tolerance);
    EXPECT_NEAR(run.value("axle.position.y"), 0, 10 * tolerance);
    // m v^2 / r = 6 * 1 / 2 inwards, along z x longitudinal, which is y here; about half of it at each wheel (the least
    // reactions of wheels and hubs together).
    EXPECT_NEAR(run.value("left_tread.lateral_force") + run.value("right_tread.lateral_force"), 3, 100 * tolerance);
    EXPECT_NEAR(run.value("left_tread.lateral_force"), 1.5, 0.1);
    EXPECT_NEAR(run.value("left_tread.normal_force") + run.value("right_tread.normal_force"), 60, 100 * tolerance);
    EXPECT_NEAR(run.value("left.angular_velocity.z"), 0.5, 10 * tolerance);
    EXPECT_NEAR(run.value("right_hub.angular_speed") - run.value("left_hub.angular_speed"), 0.5 * 1.2 / 0.2, 1e-4);
  }
}

/// A wheel that a guide leads already keeps the guide; the lateral row of the wheel is left out.
TEST(Rolling, HolonomicConstraintsGoFirst) {
  // First in the text: the rolling; of both, the guide along y stays.
  const std::string model =
      disc("[3, 0, -9]", "position = [0, 0, 0.3]") +
      "[bodies.slide]\ntype = \"rigid\"\nmass = "
      "1\ninertia = [1, 1, 1]\nposition = [0, 0, 0.3]\n[joints.hub]\ntype = \"revolute\"\nbodies = [\"slide\", "
      "\"disc\"]\nat = [0, 0, 0.3]\naxis = [0, 1, 0]\n[joints.way]\ntype = \"prismatic\"\nbodies = [\"ground\", "
      "\"slide\"]\nat = [0, 0, 0.3]\naxis = [1, 0, 0]\n";
  Simulation run = simulated(model + bdf(1));
  ASSERT_EQ(run.summary().redundant.size(), 2U);  // the height, and the lateral slip
  const auto left_out = [&](const std::string& row) {
    const auto& lines = run.summary().redundant;
    return std::count_if(lines.begin(), lines.end(), [&](const std::string& line) { return line.starts_with(row); });
  };
  EXPECT_EQ(left_out("rolling \"rolls\", lateral slip"), 1);
  EXPECT_EQ(left_out("prismatic \"way\""), 1);
  EXPECT_NEAR(run.value("disc.position.x"), 0.5 * (9.0 / 4.0), 1e-6);  // (2 + 1) 3 / (3 + 1)
}

TEST(Rolling, RestsOnASpringWithoutFriction) {
  const std::string spring =
      "[forces.spring]\ntype = \"axial-spring\"\nbodies = [\"ground\", \"disc\"]\nat = [0, 0, 0.3]\naxis = [1, 0, 0]\n"
      "stiffness = 20\nrest = 0\n";
  Simulation run = simulated(disc("[3, 0, -9]", "position = [0, 0, 0.3]") + spring + "[statics]\n");
  EXPECT_NEAR(run.value("disc.position.x"), 0.3, 1e-8);  // 2 * 3 / 20
  EXPECT_NEAR(run.value("disc.rotation.y"), 1, 1e-6);    // it has rolled there
  EXPECT_NEAR(run.value("rolls.longitudinal_force"), 0, 1e-7);
  EXPECT_NEAR(run.value("rolls.normal_force"), 18, 1e-7);
}

TEST(Rolling, GoesOnFromARestart) {
  const std::string motion =
      "position = [0, 0, 0.27]\nrotation = [0.4510268117962624, 0, 0]\nangular_velocity = [1, 4, 2]";
  for (const std::string& integrator : {bdf(1), alpha(1e-2, 1)}) {
    const std::string text = disc("[0, 0, -9.81]", motion) + integrator;
    Simulation whole, rest;
    ASSERT_TRUE(whole.load_text(text, "disc.toml").ok());
    ASSERT_TRUE(rest.load_text(text, "disc.toml").ok());
    ASSERT_TRUE(whole.step_to(0.5).ok());
    ASSERT_TRUE(rest.restore(whole.save()).ok());
    ASSERT_TRUE(whole.step_to(1).ok());
    ASSERT_TRUE(rest.step_to(1).ok());
    for (const char* q : {"disc.position.x", "disc.position.y", "disc.rotation.x"})
      EXPECT_EQ(whole.value(q), rest.value(q)) << q;
  }
}

/// Down the incline x = g sin t^2 / 2 / (1 + J / (m R^2)).
TEST(Rolling, ForwardDerivatives) {
  const std::string text =
      replaced(disc("[3, 0, -9]", "position = [0, 0, 0.3]"), "[0, 0.09, 0]", "[0, \"inertia\", 0]");
  SimulationOptions options;
  options.quantities = {"disc.position.x", "rolls.longitudinal_force"};
  const std::string model = text + "[parameters]\ninertia = 0.09\n" + bdf(1);
  const SensitivityResult r = sensitivities_of_text(model, "disc.toml", {{"parameters.inertia"}}, options);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  const double share = 0.09 / 0.18, of = 1 / 0.18;
  EXPECT_NEAR(r.derivatives.back(), -2 * 3 * of / ((1 + share) * (1 + share)), 1e-5);
}

std::string message_of(const std::string& text) {
  Simulation run;
  Status status = run.load_text(text, "disc.toml");
  if (status.ok()) status = run.run();
  return status.message;
}

/// The example of the guide, with the settings that it has.
TEST(Rolling, GuidesDisc) {
  const std::string page = content_of((espalier::test::source_folder() / "docs/guide/simulate.md").string());
  const std::size_t begin = page.find("```toml\n", page.find("### Rolling")) + 8;
  Simulation run = simulated(page.substr(begin, page.find("```", begin) - begin));
  EXPECT_NEAR(run.value("disc.position.x"), 4, 1e-3);
  EXPECT_NEAR(run.value("rolls.longitudinal_force"), -2, 1e-3);
}

TEST(Rolling, MistakesAreNamed) {
  const std::string model = disc("[3, 0, -9]", "position = [0, 0, 0.3]") + bdf(1);
  const std::vector<Mistake> mistakes = {
      {"no plane",
       replaced(model, "body = \"ground\", axis = [0, 0, 1]", "body = \"ground\""),
       {"rolls", "the plane", "axis"}},
      {"no axle", replaced(model, "body = \"disc\", axis = [0, 1, 0]", "body = \"disc\""), {"rolls", "axle"}},
      {"no radius", replaced(model, "radius = 0.3", ""), {"radius"}},
      {"radius", replaced(model, "radius = 0.3", "radius = -1"), {"radius"}},
      {"rim", replaced(model, "radius = 0.3", "radius = 0.3\nrim = 0.4"), {"rim", "ball"}},
      {"ball's rim", replaced(model, "radius = 0.3", "radius = 0.3\nshape = \"ball\"\nrim = 0.1"), {"ball has no rim"}},
      {"shape", replaced(model, "radius = 0.3", "radius = 0.3\nshape = \"cube\""), {"shape", "wheel, ball"}},
      {"flat", replaced(model, "axis = [0, 1, 0]", "axis = [0, 0, 1]"), {"lies flat"}},
      {"a key too many", replaced(model, "radius = 0.3", "radius = 0.3\nlength = 1"), {"length"}},
  };
  for (const Mistake& m : mistakes) {
    const std::string message = message_of(m.text);
    for (const std::string& word : m.says)
      EXPECT_NE(message.find(word), std::string::npos) << m.name << ": " << message;
  }
}

TEST(Rolling, AdjointAndEquilibriaAreRefusedWithReasons) {
  const std::string model = disc("[3, 0, -9]", "position = [0, 0, 0.3]");
  SimulationOptions options;
  options.quantities = {"disc.position.x"};
  const auto message = [&](const std::string& text, SensitivityMethod method) {
    return sensitivities_of_text(text, "disc.toml", {{"gravity[0]"}}, options, method).status.message;
  };
  EXPECT_NE(message(model + bdf(1), SensitivityMethod::adjoint).find("does not pass rolling"), std::string::npos);
  EXPECT_NE(message(model + "[statics]\n", SensitivityMethod::forward).find("do not pass rolling"), std::string::npos);
}

}  // namespace rolling_test
}  // namespace espalier::dynamics
