// What joints mean where the text leaves something out: axes, and how faces are held. Truth: closed forms, the same
// model with everything given, and a plate whose frequencies are known.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace joint_frames_test {

std::string rod(const std::string& joint) {
  return "gravity = [0, 0, -9.81]\n[bodies.rod]\ntype = \"rigid\"\nmass = 1\ninertia = [0.01, 0.02, 0.03]\n"
         "position = [0.5, 0, 0]\n[markers.eye]\nbody = \"rod\"\npoint = [-0.5, 0, 0]\n[joints.hinge]\n" +
         joint + "\n[integrator]\nrelative = 1e-9\nabsolute = 1e-9\nend = 0.3\n";
}

// A hinge without an axis turned about z, and the rod stood in the air.
TEST(JointAxes, MustBeGivenWhereTheyMatter) {
  for (const std::string type : {"revolute", "universal", "cylindrical", "prismatic", "planar", "point-on-line",
                                 "revolute-spherical", "rotation-motor", "translation-motor"})
    for (const std::string frames : {"bodies = [\"ground\", \"rod\"]\nat = [0, 0, 0]",
                                     "a = { body = \"ground\" }\nb = { body = \"rod\", point = [-0.5, 0, 0] }",
                                     "a = { body = \"ground\" }\nb = \"eye\""}) {
      Simulation run;
      const std::string motion = type.find("motor") == std::string::npos ? "" : "\nmotion = \"0\"";
      const Status status = run.load_text(rod("type = \"" + type + "\"\n" + frames + motion), "model.toml");
      EXPECT_EQ(status.code, StatusCode::invalid_input) << type;
      for (const char* word : {"joints.hinge", "needs an axis", "axis = [x, y, z]"})
        EXPECT_NE(status.message.find(word), std::string::npos) << type << ": " << status.message;
    }
  for (const std::string type : {"fixed", "spherical"})
    EXPECT_TRUE(
        simulated(rod("type = \"" + type + "\"\nbodies = [\"ground\", \"rod\"]\nat = [0, 0, 0]")).summary().steps > 0);
}

TEST(JointAxes, OfForcesToo) {
  const std::string model =
      rod("type = \"revolute\"\nbodies = [\"ground\", \"rod\"]\nat = [0, 0, 0]\naxis = [0, 1, 0]");
  for (const std::string force :
       {"type = \"rotational-spring\"\nstiffness = 1", "type = \"axial-spring\"\nstiffness = 1",
        "type = \"torque-motor\"\ntorque = 1", "type = \"force-motor\"\nforce = 1"}) {
    Simulation run;
    const Status status = run.load_text(
        model + "[forces.f]\nbodies = [\"ground\", \"rod\"]\nat = [0, 0, 0]\n" + force + "\n", "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << force;
    EXPECT_NE(status.message.find("needs an axis"), std::string::npos) << status.message;
  }
}

// One frame says where the axis points; the other takes it from there, on a body that is turned, too. Truth: both
// given.
TEST(JointAxes, OneOfTwoFramesIsEnough) {
  const auto ends = [](const std::string& a, const std::string& b) {
    std::string text = rod("type = \"revolute\"\na = { body = \"ground\"" + a + " }\nb = { body = \"rod\"" + b + " }");
    text = replaced(text, "position = [0.5, 0, 0]", "position = [0, 0, 0.5]\nrotation = [0, \"-pi/2\", 0]");
    const Simulation run = simulated(text);
    EXPECT_LT(run.summary().position_change, 1e-9) << a << b;
    return std::pair(run.value("rod.position.x"), run.value("rod.position.y"));
  };
  const std::string point = ", point = [-0.5, 0, 0]";
  const auto truth = ends(", axis = [1, 0, 0]", point + ", axis = [0, 0, -1]");
  EXPECT_NEAR(std::abs(truth.second) + std::abs(truth.first), 0, 1e-7);  // it stands on its head
  const auto swings = ends(", axis = [0, 1, 0]", point + ", axis = [0, 1, 0]");
  const auto first = ends(", axis = [0, 1, 0]", point), second = ends("", point + ", axis = [0, 1, 0]");
  EXPECT_NEAR(first.first, swings.first, 1e-12);
  EXPECT_NEAR(second.first, swings.first, 1e-12);
}

std::string plate(const std::string& hold, int along, int across) {
  return fmt::format(
      "[bodies.plate]\ntype = \"solid\"\nmesh = {{ part = \"block\", lx = 0.4, ly = 0.3, lz = 0.002, divisions = [{}, "
      "{}, "
      "1] }}\nhex8 = \"shell\"\nmaterial = {{ young = 70e9, poisson = 0.33, density = 2700 }}\n[joints.clamp]\ntype = "
      "\"fixed\"\na = {{ body = \"ground\", point = [0, 0.15, 0.001] }}\nb = {{ body = \"plate\", face = \"x0\" "
      "}}\n{}\n"
      "[initial]\nmodes = 4\n[integrator]\nmax_order = 2\nend = 1e-9\n",
      along, across, hold);
}

// A plate of aluminium, one edge held. Truth: thin plates (A. Leissa, "Vibration of plates", NASA SP-160, 1969): 10.76,
// 32.48, 67.09, 112.58 Hz. Held in the mean its edge warps: the second and the fourth mode, which twist it, are too
// slow.
TEST(Attach, AFixedFaceIsClamped) {
  const double truth[] = {10.76, 32.48, 67.09, 112.58};
  const Simulation clamped = simulated(plate("", 16, 12)), rigid = simulated(plate("attach = \"rigid\"", 16, 12)),
                   mean = simulated(plate("attach = \"mean\"", 16, 12));
  ASSERT_EQ(clamped.summary().modes.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(clamped.summary().modes[i].frequency / truth[i], 1, 0.02) << i;
    EXPECT_EQ(clamped.summary().modes[i].frequency, rigid.summary().modes[i].frequency);
  }
  EXPECT_LT(mean.summary().modes[1].frequency, 0.85 * truth[1]);
  EXPECT_LT(mean.summary().modes[3].frequency, 0.9 * truth[3]);
  const auto says = [](const Simulation& run, const char* word) {
    for (const std::string& notice : run.summary().notices)
      if (notice.find(word) != std::string::npos) return true;
    return false;
  };
  EXPECT_TRUE(says(clamped, "clamps face 'x0' of 'plate'"));
  EXPECT_FALSE(says(rigid, "clamps"));
  EXPECT_FALSE(says(mean, "clamps"));
}

// The reaction of a clamp is that of the joint: weight and moment. The rigid face keeps its shape under any load.
TEST(Attach, ReactionsAndShapeOfARigidFace) {
  const std::string bar =
      "gravity = [0, 0, -10]\n[bodies.bar]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 1, ly = 0.1, lz = 0.1, "
      "divisions = [6, 2, 2] }\nmaterial = { young = 1e8, poisson = 0.3, density = 1000 }\n[bodies.weight]\ntype = "
      "\"rigid\"\nmass = 2\nbox = [0.1, 0.1, 0.1]\nposition = [1.1, 0.05, 0.05]\n[joints]\nclamp = { type = \"fixed\", "
      "a "
      "= { body = \"ground\", point = [0, 0.05, 0.05] }, b = { body = \"bar\", face = \"x0\" } }\nhang = { type = "
      "\"revolute\", attach = \"rigid\", a = { body = \"bar\", face = \"x1\", axis = [0, 0, 1] }, b = { body = "
      "\"weight\", "
      "point = [-0.1, 0, 0] } }\n[markers]\nlow = { body = \"bar\", near = [1, 0, 0] }\nhigh = { body = \"bar\", near "
      "= [1, "
      "0.1, 0.1] }\nroot = { body = \"bar\", near = [0, 0.1, 0] }\n[statics]\n";
  const Simulation run = simulated(bar);
  EXPECT_NEAR(run.value("clamp.force.z"), 120, 1e-5);  // on the bar's side: 10 kg and 2 kg
  // The weight hangs behind the end as that moves and turns; the moment is large displacement's: to a percent of 72.
  EXPECT_NEAR(std::abs(run.value("clamp.moment.y")), 72, 0.8);
  const auto distance = [&](const std::string& a, const std::string& b) {
    double sum = 0;
    for (const char* c : {"x", "y", "z"})
      sum += std::pow(run.value(a + ".position." + c) - run.value(b + ".position." + c), 2);
    return std::sqrt(sum);
  };
  EXPECT_NEAR(distance("low", "high"), 0.1 * std::sqrt(2.0), 1e-9);
  EXPECT_NEAR(run.value("root.position.x"), 0, 1e-12);
  EXPECT_NEAR(run.value("root.position.y"), 0.1, 1e-12);
}

TEST(Attach, SaysWhatCannotBe) {
  const std::string model = plate("", 2, 2);
  const auto refused = [](const std::string& text, const char* word) {
    Simulation run;
    const Status status = run.load_text(text, "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << word;
    EXPECT_NE(status.message.find(word), std::string::npos) << status.message;
  };
  refused(replaced(model, "face = \"x0\" }", "node = 1, attach = \"rigid\" }"), "needs a face");
  refused(rod("type = \"fixed\"\nattach = \"rigid\"\nbodies = [\"ground\", \"rod\"]\nat = [0, 0, 0]"),
          "none of the joint's");
  refused(replaced(model, "face = \"x0\" }", "face = \"x0\", attach = \"stiff\" }"), "rigid");
  refused(replaced(replaced(model, "face = \"x0\" }", "face = \"x0\", attach = \"rigid\" }"), "hex8 = \"shell\"\n",
                   "reduce = { modes = 2 }\n"),
          "reduced");
}

// A reduced body has no nodes to clamp: the mean is held, which a notice says.
TEST(Attach, OfAReducedBodyIsTheMean) {
  const Simulation run =
      simulated(replaced(plate("", 4, 3), "hex8 = \"shell\"\n", "hex8 = \"shell\"\nreduce = { modes = 4 }\n"));
  bool said = false;
  for (const std::string& notice : run.summary().notices)
    said = said || notice.find("holds the mean") != std::string::npos;
  EXPECT_TRUE(said);
}

// f(t) - f(start) of a constant is nothing: a model that asks for it means something else.
TEST(Motion, AConstantThatCountsFromTheStartIsRefused) {
  const std::string block = "[bodies.block]\ntype = \"rigid\"\nmass = 1\nbox = [1, 1, 1]\nposition = [0.3, 0, 0]\n";
  const auto led = [&](const std::string& motion) {
    return block +
           "[joints.way]\ntype = \"prescribed\"\na = \"ground\"\nb = \"block\"\ndirection = \"x\"\nfrom = "
           "\"initial\"\nmotion = \"" +
           motion + "\"\n[integrator]\nend = 1\n";
  };
  Simulation run;
  const Status status = run.load_text(led("0.01"), "model.toml");
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  EXPECT_NE(status.message.find("moves nothing"), std::string::npos) << status.message;
  EXPECT_NEAR(simulated(led("0")).value("block.position.x"), 0.3, 1e-12);
  EXPECT_NEAR(simulated(led("1 + 0.01 * t * t")).value("block.position.x"), 0.31, 1e-9);
}

}  // namespace joint_frames_test
}  // namespace espalier::dynamics
