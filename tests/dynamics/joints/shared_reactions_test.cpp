// Reactions that redundant constraints leave open: those of least norm. Truth: closed forms.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "dynamics/model/model_common.hpp"
#include "espalier/model_harmonic.hpp"

namespace espalier::dynamics {
namespace shared_reactions_test {

/// A table of 8 kg on four legs at (+-a, +-b), with its centre of mass at (x, y).
std::string table(double x, double y) {
  std::string text = fmt::format(
      "gravity = [0, 0, -10]\n[bodies.top]\ntype = \"rigid\"\nmass = 8\ninertia = [1, 1, 1]\nposition = [{}, {}, 0]\n",
      x, y);
  const double legs[4][2] = {{0.6, 0.4}, {-0.6, 0.4}, {-0.6, -0.4}, {0.6, -0.4}};
  for (int k = 0; k < 4; ++k)
    text += fmt::format(
        "[joints.leg{}]\ntype = \"prescribed\"\na = {{ body = \"ground\", point = [{}, {}, 0] }}\nb = {{ body = "
        "\"top\", "
        "point = [{}, {}, 0] }}\nmotion = \"0\"\ndirection = \"z\"\n",
        k, legs[k][0], legs[k][1], legs[k][0] - x, legs[k][1] - y);
  return text + "[integrator]\nend = 1e-3\n";
}

// F / 4 (1 +- x / a +- y / b): the shares that vary evenly over the table.
TEST(SharedReactions, OfATableOnFourLegs) {
  for (const auto& [x, y] : {std::pair(0.0, 0.0), std::pair(0.15, 0.0), std::pair(0.15, -0.1)}) {
    const Simulation s = simulated(table(x, y));
    ASSERT_EQ(s.summary().redundant.size(), 1U);
    EXPECT_NE(s.summary().redundant[0].find("least norm"), std::string::npos) << s.summary().redundant[0];
    const double sign[4][2] = {{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
    for (int k = 0; k < 4; ++k)
      EXPECT_NEAR(std::abs(s.value(fmt::format("leg{}.force.z", k))),
                  20 * (1 + sign[k][0] * x / 0.6 + sign[k][1] * y / 0.4), 1e-6)
          << x << ", " << y << ", leg " << k;
  }
}

// The same in statics, linear or not, and in a frequency response, where a load of 8 is added to the weight.
TEST(SharedReactions, OfATableAtRestAndShaken) {
  const std::string legs =
      replaced(table(0, 0), "[integrator]\nend = 1e-3\n", "") +
      "[joints.rail]\ntype = \"prismatic\"\nbodies = [\"ground\", \"top\"]\nat = [0, 0, 0]\naxis = [0, 0, "
      "1]\n[forces.push]\ntype = \"load\"\na = { body = \"top\" }\nforce = [0, 0, 1]\nfactor = \"0\"\n";
  for (const char* statics : {"[statics]\n", "[statics]\nlinear = true\n"}) {
    const Simulation s = simulated(legs + statics);
    for (int k = 0; k < 4; ++k) EXPECT_NEAR(s.value(fmt::format("leg{}.force.z", k)), 20, 1e-6) << statics;
  }
  const ModelHarmonicResult r = model_harmonic_of_text(
      legs +
          "[harmonic]\nfrequencies = [10]\nloads = { push = 8 }\nquantities = [\"leg0.force.z\", \"leg1.force.z\", "
          "\"leg2.force.z\", \"leg3.force.z\"]\n",
      "model.toml");
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  for (Index k = 0; k < 4; ++k) EXPECT_NEAR(std::abs(r.response.response(0, 0, k) + 2.0), 0, 1e-6) << k;
}

// A door on two hinges on one line shares its weight, and what it pulls sidewards, in any unit of length.
TEST(SharedReactions, OfADoorOnTwoHinges) {
  for (const double unit : {1.0, 1e3}) {
    const Simulation s = simulated(
        fmt::format("gravity = [0, 0, \"-10*u\"]\n[parameters]\nu = {}\n", unit) +
        "[bodies.door]\ntype = \"rigid\"\nmass = 30\ninertia = [\"9*u^2\", \"9*u^2\", \"2*u^2\"]\nposition = "
        "[\"0.5*u\", 0, \"u\"]\n[joints.low]\ntype = \"revolute\"\nbodies = [\"ground\", \"door\"]\nat = [0, 0, "
        "\"0.5*u\"]\naxis = [0, 0, 1]\n[joints.high]\ntype = \"revolute\"\nbodies = [\"ground\", \"door\"]\nat = [0, "
        "0, "
        "\"1.5*u\"]\naxis = [0, 0, 1]\n[integrator]\nend = 1e-3\n");
    EXPECT_EQ(s.summary().redundant.size(), 5U);
    EXPECT_NEAR(std::abs(s.value("low.force.z")), 150 * unit, 1e-5 * unit);
    EXPECT_NEAR(std::abs(s.value("high.force.z")), 150 * unit, 1e-5 * unit);
    // The moment of the weight, 150, is borne by moments of the hinges and by forces 1 apart: all of it in the end.
    const double moment = s.value("low.moment.y") + s.value("high.moment.y") +
                          unit * (s.value("high.force.x") - s.value("low.force.x")) / 2;
    EXPECT_NEAR(std::abs(moment), 150 * unit * unit, 1e-4 * unit * unit);
    EXPECT_NEAR(s.value("low.moment.y") / s.value("high.moment.y"), 1, 1e-6);
  }
}

}  // namespace shared_reactions_test
}  // namespace espalier::dynamics
