// Joints that cannot be closed, and motions that cannot be followed: which, by how much, and until when.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/strtod.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

/// A crank of length 1 about the origin and, from its end at (1, 0), a rod to the ground at (x, 0).
std::string swinging_crank(const std::string& rod, const std::string& more = "[integrator]\nend = 1\n") {
  return R"([bodies.crank]
type = "rigid"
mass = 1
inertia = [1, 1, 1]
position = [0.5, 0, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "crank"]
at = [0, 0, 0]
axis = [0, 0, 1]
)" + rod +
         more;
}

std::string failure_text(const std::string& text) {
  Simulation s;
  Status status = s.load_text(text, "model.toml");
  if (status.ok()) status = s.run();
  EXPECT_FALSE(status.ok());
  return status.message;
}

/// The number that follows some words.
double number_behind(const std::string& text, const std::string& words) {
  const std::size_t at = text.find(words);
  EXPECT_NE(at, std::string::npos) << words << " in " << text;
  return at == std::string::npos ? std::nan("") : base::strtod(text.c_str() + at + words.size());
}

std::string link_rod(double x, double length) {
  return fmt::format(R"([joints.rod]
type = "distance"
a = {{ body = "ground", point = [{}, 0.1, 0] }}
b = {{ body = "crank", point = [0.5, 0, 0] }}
length = {}
)",
                     x, length);
}

TEST(ModelClosing, LengthsOutOfReach) {
  // The crank's end is between d - 1 and d + 1 from a point at the distance d from its axis.
  for (const double x : {2.0, 0.5, 7.0})
    for (const double length : {20.0, 0.01}) {
      const double d = std::hypot(x, 0.1), reach = length > d ? d + 1 : std::abs(d - 1);
      const std::string text = failure_text(swinging_crank(link_rod(x, length)));
      EXPECT_NE(text.find("joint 'rod': length"), std::string::npos) << text;
      EXPECT_NEAR(number_behind(text, "length "), length, 1e-6);
      EXPECT_NEAR(number_behind(text, "reaches "), reach, 2e-5 * reach) << text;
      EXPECT_NEAR(number_behind(text, "("), std::abs(length - reach), 1e-3 * std::abs(length - reach)) << text;
      EXPECT_NE(text.find("iterations"), std::string::npos) << text;
    }
}

TEST(ModelClosing, UnitsAreThoseOfTheModel) {
  const std::string text = failure_text("units = \"mm-t-s\"\n" + swinging_crank(link_rod(2, 20)));
  EXPECT_NE(text.find("length 20 mm is asked"), std::string::npos) << text;
}

/// A loop of four bars with lengths 1, a, b and the ground's g, all along x at the start: it closes where the longest
/// is not longer than the others together.
std::string bars_in_a_row(double ground) {
  return fmt::format(R"([bodies.crank]
type = "rigid"
mass = 1
box = [1, 0.1, 0.1]
position = [0.5, 0, 0]
[bodies.coupler]
type = "rigid"
mass = 1
box = [2, 0.1, 0.1]
position = [2, 0, 0]
[bodies.rocker]
type = "rigid"
mass = 1
box = [1.5, 0.1, 0.1]
position = [3.75, 0, 0]
[joints.a]
type = "revolute"
a = "ground"
b = {{ body = "crank", point = [-0.5, 0, 0], axis = [0, 0, 1] }}
[joints.b]
type = "revolute"
a = {{ body = "crank", point = [0.5, 0, 0], axis = [0, 0, 1] }}
b = {{ body = "coupler", point = [-1, 0, 0] }}
[joints.c]
type = "revolute"
a = {{ body = "coupler", point = [1, 0, 0], axis = [0, 0, 1] }}
b = {{ body = "rocker", point = [-0.75, 0, 0] }}
[joints.d]
type = "revolute"
a = {{ body = "rocker", point = [0.75, 0, 0], axis = [0, 0, 1] }}
b = {{ body = "ground", point = [{}, 0, 0] }}
[integrator]
end = 1
)",
                     ground);
}

TEST(ModelClosing, FourBarsTooShort) {
  for (const double ground : {4.6, 6.0, 20.0}) {  // the others are 4.5 together
    const std::string text = failure_text(bars_in_a_row(ground));
    EXPECT_NE(text.find("joint 'd' stays open by"), std::string::npos) << text;
    EXPECT_NEAR(number_behind(text, "stays open by "), ground - 4.5, 1e-3 * (ground - 4.5)) << text;
  }
}

TEST(ModelClosing, MotorsOutOfReachAtTheStart) {
  const std::string rail = R"([joints.rail]
type = "point-on-line"
a = { body = "ground", point = [0, 0.5, 0], axis = [1, 0, 0] }
b = { body = "crank", point = [0.5, 0, 0] }
[joints.slide]
type = "prescribed"
direction = "x"
motion = "3 + t"
a = "ground"
b = { body = "crank", point = [0.5, 0, 0] }
)";
  const std::string text = failure_text(swinging_crank(rail));
  EXPECT_NE(text.find("joint 'slide': a displacement of 3"), std::string::npos) << text;
  EXPECT_NEAR(number_behind(text, "reaches "), std::sqrt(0.75), 1e-4) << text;
}

TEST(ModelClosing, MotorsThatLeadBeyondADeadPoint) {
  // The end of the crank, at first at y = 0, is led along y: it comes to 1 and no further, at t = 1.
  const std::string slide = R"([joints.slide]
type = "prescribed"
direction = "y"
motion = "t"
a = "ground"
b = { body = "crank", point = [0.5, 0, 0] }
)";
  for (const char* integrator :
       {"[integrator]\nend = 3\n", "[integrator]\nend = 3\nmethod = \"generalized-alpha\"\nstep = 0.01\n"}) {
    const std::string text = failure_text(swinging_crank(slide, integrator));
    EXPECT_NE(text.find("cannot follow what leads it: joint 'slide'"), std::string::npos) << text;
    EXPECT_NEAR(number_behind(text, "from t = "), 1, 0.02) << text;
  }
}

TEST(ModelClosing, StaticsSayItToo) {
  const std::string text = failure_text(swinging_crank(link_rod(2, 20), "[statics]\n"));
  EXPECT_NE(text.find("joint 'rod': length 20 is asked"), std::string::npos) << text;
}

/// A motor that goes far in the time that is left is not one that cannot be followed.
TEST(ModelClosing, MotorsThatTravelFarAreNotBlamed) {
  const std::string text = failure_text(
      "[bodies.b]\ntype = \"rigid\"\nmass = 1\nbox = [1, 1, 1]\n[bodies.c]\ntype = \"rigid\"\nmass = 1\nbox = [1, 1, "
      "1]\n"
      "position = [3, 0, 0]\n[joints.m]\ntype = \"translation-motor\"\nbodies = [\"ground\", \"b\"]\nat = [0, 0, "
      "0]\naxis = [1, 0, 0]\n"
      "motion = \"1e4*t\"\n[forces.f]\ntype = \"load\"\na = \"c\"\nforce = [\"1/(0.001 - t)\", 0, "
      "0]\n[integrator]\nend = 1000\n");
  EXPECT_EQ(text.find("cannot follow"), std::string::npos) << text;
}

/// Other failures keep their words.
TEST(ModelClosing, MechanismsThatCloseAreNotBlamed) {
  const std::string text =
      failure_text(swinging_crank("",
                                  "[integrator]\nend = 1\nmethod = \"generalized-alpha\"\nstep = 0.1\n"
                                  "[forces.x]\ntype = \"load\"\na = \"crank\"\nforce = [\"1/(t - 0.5)^2\", 0, 0]\n"));
  EXPECT_EQ(text.find("cannot follow"), std::string::npos) << text;
  EXPECT_EQ(text.find("No positions"), std::string::npos) << text;
}

}  // namespace
}  // namespace espalier::dynamics
