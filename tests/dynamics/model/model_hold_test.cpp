// Joints hold faces where they are. Truth: what is held is not strained (energy 0, given positions to the bit), and
// carries its weight with the moment of its lever arm; what is pulled costs the energy that is said.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

/// A bracket of steel, 100 x 20 x 20 mm, welded with its face x0 (mean at the origin) to a place of the ground.
std::string bracket(const std::string& ground, const std::string& joint = "fixed", const std::string& more = "") {
  return fmt::format(R"(gravity = [0, 0, -10]
[bodies.bracket]
type = "solid"
mesh = {{ part = "block", lx = 0.1, ly = 0.02, lz = 0.02, divisions = [10, 2, 2] }}
position = [0, -0.01, -0.01]
material = {{ young = 2.1e11, poisson = 0.3, density = 7850 }}
gravity = [0, 0, 0]
[markers.corner]
body = "bracket"
near = [0.1, 0.02, 0.02]
[markers.root]
body = "bracket"
near = [0, 0, 0]
[joints.weld]
type = "{}"
a = {{ body = "ground", {} }}
b = {{ body = "bracket", face = "x0" }}
{}
)",
                     joint, ground, more);
}

const std::string kMotion = "[integrator]\nmethod = \"generalized-alpha\"\nstep = 1e-6\nend = 1e-6\n";

bool contains(const std::vector<std::string>& lines, std::initializer_list<const char*> words) {
  return std::any_of(lines.begin(), lines.end(), [&](const std::string& line) {
    return std::all_of(words.begin(), words.end(), [&](const char* w) { return line.find(w) != std::string::npos; });
  });
}

TEST(ModelHold, NothingIsStrainedWhateverThePlaceOfTheJoint) {
  struct Case {
    const char* ground;
    const char* distance;
  };
  for (const Case& c : {Case{"point = [0, 1e-5, 0], axis = [0, 0, 1]", "1e-05"},
                        Case{"point = [1e-5, 0, 0], axis = [0, 0, 1]", "1e-05"},
                        Case{"point = [0, 0, 1e-4], axis = [0, 0, 1]", "0.0001"},
                        Case{"point = [-1e-3, 0, 0], axis = [0, 0, 1]", "0.001"},
                        Case{"point = [0.02, 0.05, -0.03], axis = [0, 0, 1]", "0.0616"},
                        Case{"point = [1e-3, 0, 0], axis = [1, 2, 3], x_axis = [0, 1, 0]", "turned by"}}) {
    for (const char* joint : {"fixed", "revolute", "spherical", "cylindrical", "prismatic", "universal"}) {
      const Simulation s = simulated(bracket(c.ground, joint, kMotion));
      EXPECT_NEAR(s.summary().energy_begin.potential, 0, 1e-12) << c.ground << joint;
      EXPECT_EQ(s.value("corner.position.x"), 0.1) << c.ground << joint;
      EXPECT_LT(s.summary().largest_violation.position, 1e-10) << c.ground << joint;
      if (std::string(joint) != "fixed") continue;
      EXPECT_TRUE(contains(s.summary().notices, {"weld", "face 'x0'", "'bracket'", c.distance})) << c.ground;
    }
  }
}

TEST(ModelHold, WhatFitsIsNotMentioned) {
  const Simulation s = simulated(bracket("point = [0, 0, 0]", "fixed", "attach = \"mean\"\n[statics]\n"));
  EXPECT_TRUE(s.summary().notices.empty()) << s.summary().notices.front();
}

TEST(ModelHold, TheLeverArmCarriesTheMoment) {
  // Weight m g at x = 0.05, joint at [-0.02, 0, 0.03]: force m g up, moment 0.07 m g about -y on the frame.
  std::string text = bracket("point = [-0.02, 0, 0.03]", "fixed", "[statics]\n");
  text.replace(text.find("gravity = [0, 0, 0]"), 19, "gravity = [0, 0, -10]");
  const Simulation s = simulated(text);
  const double weight = 7850 * 0.1 * 0.02 * 0.02 * 10;
  EXPECT_NEAR(s.value("weld.force.z"), weight, 1e-7 * weight);
  EXPECT_NEAR(s.value("weld.moment.y"), -0.07 * weight, 1e-4 * weight);  // the arm sags by some micrometres
}

TEST(ModelHold, PullStrainsAndSaysSo) {
  const Simulation s = simulated(bracket("point = [0, 1e-5, 0]", "fixed\"\npull = true\n#\"", kMotion));
  EXPECT_GT(s.summary().energy_begin.potential, 0.1);
  EXPECT_TRUE(contains(s.summary().notices, {"weld", "open by 1e-05"}));
  EXPECT_TRUE(contains(s.summary().notices, {"bracket", "up to", "strain energy",
                                             fmt::format("{:.4g}", s.summary().energy_begin.potential).c_str()}));
}

TEST(ModelHold, StaticsPullsARestingBodyWithoutStrain) {
  // Nothing else holds it: it goes where the joint wants it, as it is.
  for (const char* place : {"point = [0, 1e-5, 0]", "point = [1e-3, 0, 0]", "point = [0.1, -0.3, 0.2]"}) {
    const Simulation s = simulated(bracket(place, "fixed\"\npull = true\n#\"", "[statics]\n"));
    EXPECT_NEAR(s.summary().energy_end.potential, 0, 1e-9) << place;
    EXPECT_LT(s.summary().largest_violation.position, 1e-9) << place;
  }
}

TEST(ModelHold, ANodeStaysAndTheGroundMoves) {
  const Simulation s = simulated(bracket(
      "point = [0, 0, 0]", "fixed",
      "[joints.pin]\ntype = \"spherical\"\na = { body = \"ground\", point = [0.1, 0, 1e-3] }\nb = \"corner\"\n" +
          kMotion));
  EXPECT_NEAR(s.summary().energy_begin.potential, 0, 1e-12);
  EXPECT_TRUE(contains(s.summary().notices, {"pin", "'bracket'", "apart"}));
}

TEST(ModelHold, RigidBodiesThatAreMovedAreNamedWithTheirDistance) {
  const Simulation s = simulated(R"([bodies.bob]
type = "rigid"
mass = 1
box = [0.1, 0.1, 0.1]
position = [1, 0, 0]
[joints.pin]
type = "spherical"
a = { body = "ground", point = [1, 0, 0] }
b = { body = "bob", point = [0, 0, 0.002] }
)" + kMotion);
  EXPECT_TRUE(contains(s.summary().notices, {"pin", "open by 0.002"}));
  EXPECT_TRUE(contains(s.summary().notices, {"bob", "moved it by 0.0"}));
}

TEST(ModelHold, MistakesHaveTheirPlace) {
  Simulation s;
  const Status status = s.load_text(bracket("point = [0, 0, 0]", "fixed\"\npull = 3\n#\"", kMotion), "model.toml");
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  EXPECT_NE(status.message.find("joints.weld.pull"), std::string::npos) << status.message;
}

}  // namespace
}  // namespace espalier::dynamics
