// Small motions about steady motions. Truth: the benchmark bicycle (J. Meijaard, J. Papadopoulos, A. Ruina, A. Schwab,
// Proc. R. Soc. A 463, 2007), closed forms of rotors, Southwell's blade (A. Wright, C. Smith, R. Thresher, J. Wang,
// J. Appl. Mech. 49, 1982).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "dynamics/model/model_common.hpp"
#include "espalier/model_modes.hpp"

namespace espalier::dynamics {
namespace steady_modes_test {

constexpr double kTwoPi = 2 * std::numbers::pi;

std::vector<SimulationMode> modes_of(const std::string& text, const std::vector<std::string>& set = {}) {
  SimulationOptions options;
  options.set = set;
  Simulation run(options);
  Status status = run.load_text(text, "model.toml");
  if (status.ok() && text.find("[statics]") != std::string::npos) status = run.run();
  EXPECT_TRUE(status.ok()) << status.message;
  return run.summary().modes;
}

bool has(const std::vector<SimulationMode>& modes, std::complex<double> e, double tolerance) {
  for (const SimulationMode& m : modes)
    if (std::abs(std::complex<double>(m.growth, kTwoPi * m.frequency) - e) <= tolerance * std::abs(e)) return true;
  return false;
}

std::string list(const std::vector<SimulationMode>& modes) {
  std::string text;
  for (const SimulationMode& m : modes)
    text += fmt::format("{:.12g} +- {:.12g} i, whirl {:.6g}, standing {:.9g}\n", m.growth, kTwoPi * m.frequency,
                        m.whirl, m.standing_frequency);
  return text;
}

const std::string kBicycle = content_of((espalier::test::source_folder() / "examples/bicycle.toml").string());

TEST(SteadyModes, BenchmarkBicycle) {
  using E = std::complex<double>;
  struct Case {
    double speed;
    std::vector<E> eigenvalues;
  };
  // Table 2 of the paper; at rest the pairs are real.
  const std::vector<Case> cases = {
      {1, {E(3.526961709900704, 0.807740275199305), -3.134231250665178, -7.110080146374420}},
      {3, {E(1.706756056639746, 2.315824473843138), -2.633661372536670, -10.351014672459200}},
      {5, {E(-0.775341882195845, 4.464867713788229), -0.322866429004087, -14.078389692798222}},
      {8, {E(-2.69348683581091, 8.46037971396929), 0.143278797657123, -20.2794089439454}},  // from its M, C1, K0, K2
  };
  for (const Case& c : cases) {
    const std::vector<SimulationMode> modes = modes_of(kBicycle, {fmt::format("parameters.speed={}", c.speed)});
    for (const E e : c.eigenvalues) EXPECT_TRUE(has(modes, e, 1e-8)) << c.speed << ": " << e << "\n" << list(modes);
  }
}

TEST(SteadyModes, BicycleAtRestFallsOver) {
  const std::vector<SimulationMode> modes = modes_of(kBicycle, {"parameters.speed=0"});
  // In each pair: the one that grows.
  EXPECT_TRUE(has(modes, 3.131643247906656, 1e-9)) << list(modes);
  EXPECT_TRUE(has(modes, 5.530943717653393, 1e-9)) << list(modes);
}

TEST(SteadyModes, OverTheSpeed) {
  const ModelModesResult r =
      model_modes_of_text(kBicycle, "bicycle.toml", "parameters.speed", {4.0, 4.28, 4.3, 5.9, 6.02, 6.03});
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  ASSERT_EQ(r.points.size(), 6U);
  std::vector<bool> stable;
  for (const ModelModesPoint& p : r.points)
    stable.push_back(
        std::all_of(p.modes.begin(), p.modes.end(), [](const SimulationMode& m) { return m.growth < 1e-6; }));
  // Stable between 4.292 and 6.024 m/s.
  EXPECT_EQ(stable, (std::vector<bool>{false, false, true, true, true, false}));
  const std::string table = modes_table(r);
  EXPECT_EQ(table.find("parameters.speed,mode,frequency,damping_ratio,growth,whirl,standing_frequency\n4,1,"), 0U)
      << table;
}

/// A disc that spins in a housing without spin on springs: tilts with Jd q'' -+ i Jp W q' + k q = 0.
std::string rotor(const std::string& spring, double diameter, double speed) {
  return fmt::format(
      "[bodies.disc]\ntype = \"rigid\"\nmass = 20\ninertia = [{1}, {1}, 0.9]\n[bodies.housing]\ntype = \"rigid\"\n"
      "mass = 1\ninertia = [0.05, 0.05, 0.05]\n[joints.bearing]\ntype = \"revolute\"\nbodies = [\"housing\", "
      "\"disc\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n[forces.mount]\ntype = \"bushing\"\nbodies = [\"ground\", "
      "\"housing\"]\nat = [0, 0, 0]\n{0}\n[initial]\nmodes = 8\nrotation = {{ axis = [0, 0, 1], speed = {2}, bodies = "
      "[\"disc\"] }}\n[integrator]\nend = 1e-3\n",
      spring, diameter, speed);
}

TEST(SteadyModes, GyroscopicSplitting) {
  const std::string spring = "stiffness = [4e5, 4e5, 9e5]\nangular_stiffness = [3e3, 3e3, 5e3]";
  constexpr double kJd = 0.55, kJp = 0.9, kStiff = 3e3;
  for (const double speed : {0.0, 50.0, 400.0, -200.0}) {
    const std::vector<SimulationMode> modes = modes_of(rotor(spring, 0.5, speed));
    const double half = kJp * std::abs(speed) / (2 * kJd), root = std::sqrt(half * half + kStiff / kJd);
    for (const auto& [w, whirl] : {std::pair(root + half, 1.0), {root - half, -1.0}}) {
      const auto it = std::find_if(modes.begin(), modes.end(), [w = w](const SimulationMode& m) {
        return std::abs(kTwoPi * m.frequency - w) < 1e-9 * w;
      });
      ASSERT_NE(it, modes.end()) << speed << ": " << w << "\n" << list(modes);
      if (speed == 0) continue;
      EXPECT_NEAR(it->whirl, whirl, 1e-6) << speed;
      EXPECT_NEAR(it->standing_frequency, whirl * it->frequency, 1e-9);
    }
    EXPECT_TRUE(has(modes, {0, std::sqrt(4e5 / 21)}, 1e-9)) << list(modes);  // sideways
  }
}

/// Springs of two stiffnesses: det [k1 - Jd w^2, i Jp W w; -i Jp W w, k2 - Jd w^2] = 0.
TEST(SteadyModes, AnisotropicMounts) {
  const std::string spring = "stiffness = [4e5, 5e5, 9e5]\nangular_stiffness = [3e3, 5e3, 5e3]";
  constexpr double kJd = 0.55, kJp = 0.9, kSpeed = 120;
  const double b = (3e3 + 5e3) * kJd + kJp * kJp * kSpeed * kSpeed, c = 3e3 * 5e3,
               root = std::sqrt(b * b - 4 * kJd * kJd * c);
  const std::vector<SimulationMode> modes = modes_of(rotor(spring, 0.5, kSpeed));
  EXPECT_TRUE(has(modes, {0, std::sqrt((b - root) / (2 * kJd * kJd))}, 1e-9)) << list(modes);
  EXPECT_TRUE(has(modes, {0, std::sqrt((b + root) / (2 * kJd * kJd))}, 1e-9)) << list(modes);
}

/// A shaft that is not round, in mounts that are: w = W +- w_n as seen from the shaft; between k1 and k2 it grows.
TEST(SteadyModes, UnroundShaftIsUnstableBetweenItsSpeeds) {
  const auto model = [](double speed) {
    return fmt::format(
        "[bodies.hub]\ntype = \"rigid\"\nmass = 1\ninertia = [0.01, 0.01, 0.02]\n[bodies.disc]\ntype = \"point\"\nmass "
        "= 2\nposition = [0, 0, 0]\n[joints.axle]\ntype = \"revolute\"\nbodies = [\"ground\", \"hub\"]\nat = [0, 0, "
        "0]\naxis = [0, 0, 1]\n[joints.drive]\ntype = \"rotation-motor\"\nbodies = [\"ground\", \"hub\"]\nat = [0, 0, "
        "0]\naxis = [0, 0, 1]\nmotion = \"{0}*t\"\n[forces.shaft]\ntype = \"bushing\"\nbodies = [\"hub\", "
        "\"disc\"]\nat "
        "= [0, 0, 0]\nstiffness = [2e4, 3e4, 5e4]\n[initial]\nmodes = 6\nrotation = {{ axis = [0, 0, 1], speed = {0} "
        "}}\n[integrator]\nend = 1e-3\n",
        speed);
  };
  const auto grows = [&](double speed) {
    const std::vector<SimulationMode> modes = modes_of(model(speed));
    return std::any_of(modes.begin(), modes.end(), [](const SimulationMode& m) { return m.growth > 1e-3; });
  };
  EXPECT_FALSE(grows(95));  // (1e4)^1/2 = 100, (1.5e4)^1/2 = 122.5
  EXPECT_TRUE(grows(110));
  EXPECT_FALSE(grows(128));
  // (a - s)(b - s) = 4 W^2 s with a = k1 / m - W^2, b = k2 / m - W^2, s = w^2
  const double w2 = 60.0 * 60, a = 1e4 - w2, b = 1.5e4 - w2, half = (a + b + 4 * w2) / 2,
               root = std::sqrt(half * half - a * b);
  const std::vector<SimulationMode> modes = modes_of(model(60));
  for (const double s : {half - root, half + root}) EXPECT_TRUE(has(modes, {0, std::sqrt(s)}, 1e-9)) << list(modes);
}

/// A body that is not round in mounts that are not: periodic coefficients, which is said.
TEST(SteadyModes, WhatIsNotSteadyIsSaid) {
  const std::string text = replaced(rotor("stiffness = [4e5, 5e5, 9e5]\nangular_stiffness = [3e3, 5e3, 5e3]", 0.5, 120),
                                    "[0.5, 0.5, 0.9]", "[0.5, 0.7, 0.9]");
  Simulation run;
  ASSERT_TRUE(run.load_text(text, "rotor.toml").ok());
  const auto& notices = run.summary().notices;
  EXPECT_TRUE(std::any_of(notices.begin(), notices.end(),
                          [](const std::string& n) { return n.find("not steady") != std::string::npos; }));
  EXPECT_TRUE(has(run.summary().modes, {0, std::sqrt(3e3 / 0.55)}, 1e-8)) << list(run.summary().modes);  // at rest
}

/// Southwell's blade: dimensionless speeds W and flapwise frequencies w, times L^2 (mass / EI)^1/2.
TEST(SteadyModes, RotatingBlade) {
  const std::string blade = content_of((espalier::test::source_folder() / "examples/blade.toml").string());
  const std::vector<std::pair<double, std::array<double, 2>>> truth = {
      {0, {3.5160, 22.0345}}, {1, {3.6816, 22.1810}}, {4, {5.5850, 24.2733}}, {12, {13.1702, 37.6031}}};
  std::vector<double> speeds;
  for (const auto& [speed, w] : truth) speeds.push_back(speed);
  const ModelModesResult r = model_modes_of_text(blade, "blade.toml", "initial.rotation.speed", speeds);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    const auto& [speed, flap] = truth[k];
    for (const double w : flap)
      EXPECT_TRUE(has(r.points[k].modes, {0, w}, 1e-3)) << speed << ": " << w << "\n" << list(r.points[k].modes);
    // In the plane of rotation: w^2 - W^2.
    const double lag = std::sqrt(flap[0] * flap[0] - speed * speed);
    EXPECT_TRUE(has(r.points[k].modes, {0, lag}, 2e-3)) << speed << ": " << lag << "\n" << list(r.points[k].modes);
  }
}

/// A mass on a spring of length 1 goes round with W: k (r - 1) = m W^2 r. As seen from there it swings along r with
/// (k / m + 3 W^2)^1/2 and along the axis with W.
TEST(SteadyModes, RelativeEquilibrium) {
  constexpr double kSpeed = 5, kRadius = 1 / (1 - 2 * kSpeed * kSpeed / 200);
  for (const std::string& run :
       {std::string("statics = true\n[integrator]\nrelative = 1e-9\nabsolute = 1e-11\nend = 1\n"),
        std::string("[statics]\n")}) {
    const std::string text =
        "[bodies.mass]\ntype = \"point\"\nmass = 2\nposition = [1.1, 0, 0]\n[forces.spring]\ntype = \"spring\"\nbodies "
        "= "
        "[\"ground\", \"mass\"]\nat = [0, 0, 0]\nstiffness = 200\nrest = 1\n[initial]\nmodes = 6\nrotation = { axis = "
        "[0, 0, 2], speed = 5 }\n" +
        run;
    const std::string model = replaced(text, "bodies = [\"ground\", \"mass\"]\nat = [0, 0, 0]",
                                       "a = { body = \"ground\" }\nb = { body = \"mass\" }");
    Simulation s = simulated(model);
    EXPECT_NEAR(std::hypot(s.value("mass.position.x"), s.value("mass.position.y")), kRadius, 1e-7);
    const std::vector<SimulationMode>& modes = s.summary().modes;
    EXPECT_TRUE(has(modes, {0, std::sqrt(100 + 3 * kSpeed * kSpeed)}, 1e-8)) << list(modes);
    EXPECT_TRUE(has(modes, {0, kSpeed}, 1e-8)) << list(modes);
    EXPECT_TRUE(std::all_of(modes.begin(), modes.end(), [](const SimulationMode& m) { return m.growth < 1e-6; }))
        << list(modes);
    if (run == "[statics]\n") continue;
    EXPECT_NEAR(s.value("mass.position.x"), kRadius * std::cos(kSpeed), 1e-6);  // and so it goes on
  }
}

/// A disc on a shaft without mass: m r'' + K11 r + K12 f = 0, Jd f'' - i Jp W f' + K21 r + K22 f = 0 as seen from rest,
/// K = EI / L^3 [12, -6 L; -6 L, 4 L^2]. What turns as one is steady as seen from the shaft, so all is converted.
TEST(SteadyModes, OverhungDiscWhirls) {
  const std::string model = content_of((espalier::test::source_folder() / "examples/overhung_disc.toml").string());
  const ModelModesResult r = model_modes_of_text(model, "disc.toml", "initial.rotation.speed", {60, 120});
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  for (const ModelModesPoint& p : r.points) {
    constexpr double kMass = 10, kJd = 0.5, kJp = 0.9, kEi = 1e4;
    // Real frequencies, positive with the rotation: zeros of (12 EI - m w^2)(4 EI - Jd w^2 + Jp W w) - 36 EI^2.
    const auto f = [&](double w) {
      return (12 * kEi - kMass * w * w) * (4 * kEi - kJd * w * w + kJp * p.value * w) - 36 * kEi * kEi;
    };
    std::vector<double> zeros;
    for (double w = -600; w < 600; w += 0.5) {
      double low = w, high = w + 0.5;
      if (f(low) * f(high) > 0) continue;
      for (int k = 0; k < 60; ++k) (f(low) * f((low + high) / 2) > 0 ? low : high) = (low + high) / 2;
      zeros.push_back(low / kTwoPi);
    }
    ASSERT_EQ(zeros.size(), 4U);
    for (const double zero : zeros)
      EXPECT_TRUE(std::any_of(p.modes.begin(), p.modes.end(),
                              [&](const SimulationMode& m) {
                                return std::abs(m.standing_frequency - zero) < 4e-4 * std::abs(zero) &&
                                       std::abs(m.whirl) > 0.999;
                              }))
          << p.value << ": " << zero << "\n"
          << list(p.modes);
  }
}

/// A bar that turns is stretched by density W^2 L^3 / (3 E).
TEST(SteadyModes, CentrifugalStretch) {
  const std::string blade = content_of((espalier::test::source_folder() / "examples/blade.toml").string());
  SimulationOptions options;
  options.set = {"parameters.speed=8"};
  Simulation s(options);
  const std::string text =
      blade + "[output]\nquantities = [\"tip.position.x\"]\n[markers.tip]\nbody = \"blade\"\nnode = -1\n";
  ASSERT_TRUE(s.load_text(text, "blade.toml").ok());
  EXPECT_NEAR(s.value("tip.position.x") - 1, 64 / (3 * 1e6), 2e-3 * 64 / (3 * 1e6));
}

TEST(SteadyModes, MistakesAreNamed) {
  const std::string model = rotor("stiffness = [4e5, 4e5, 9e5]", 0.5, 10);
  const std::vector<Mistake> mistakes = {
      {"no axis", replaced(model, "axis = [0, 0, 1], speed", "speed"), {"rotation", "axis"}},
      {"zero axis", replaced(model, "axis = [0, 0, 1], speed", "axis = [0, 0, 0], speed"), {"rotation.axis", "zero"}},
      {"no speed", replaced(model, "speed = 10, ", ""), {"rotation", "speed"}},
      {"no body", replaced(model, "[\"disc\"] }", "[\"disk\"] }"), {"no body 'disk'", "disc"}},
      {"a key too many", replaced(model, "speed = 10,", "speed = 10, rate = 3,"), {"rate"}},
  };
  for (const Mistake& m : mistakes) {
    Simulation run;
    const std::string message = run.load_text(m.text, "rotor.toml").message;
    for (const std::string& word : m.says)
      EXPECT_NE(message.find(word), std::string::npos) << m.name << ": " << message;
  }
  const ModelModesResult r = model_modes_of_text(model, "rotor.toml", "initial.rotation.sped", {1});
  EXPECT_NE(r.status.message.find("sped"), std::string::npos) << r.status.message;
  EXPECT_FALSE(model_modes_of_text(model, "rotor.toml", "initial.rotation.speed", {}).status.ok());
}

}  // namespace steady_modes_test
}  // namespace espalier::dynamics
