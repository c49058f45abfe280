// Broken expressions, splines, limits, friction, sensors and events: each must end in invalid_input with file, line,
// the name concerned and what to change.
#include <gtest/gtest.h>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

const std::string kModel = R"toml([bodies.bob]
type = "rigid"
mass = 2
inertia = [1, 1, 1]
[bodies.bar]
type = "solid"
mesh = { part = "block", divisions = [1, 1, 1] }
material = { young = 1e4, density = 100 }
[bodies.dot]
type = "point"
mass = 1
[joints]
hinge = { type = "revolute", bodies = ["ground", "bob"], at = [0, 0, 0], axis = [0, 0, 1] }
ball = { type = "spherical", bodies = ["ground", "bob"], at = [0, 0, 0] }
[integrator]
end = 1
)toml";

std::string with_torque(const std::string& torque) {
  return kModel +
         "[forces.motor]\ntype = \"torque-motor\"\nbodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\ntorque = " + torque +
         "\naxis = [0, 0, 1]\n";
}

std::string with_event(const std::string& keys) { return kModel + "[events.bang]\n" + keys + "\n"; }

std::string with_hinge(const std::string& keys) {
  std::string text = kModel;
  const std::string end = "\"bob\"], at = [0, 0, 0], axis = [0, 0, 1] }\nball";
  return text.replace(text.find(end), end.size(), "\"bob\"], at = [0, 0, 0], axis = [0, 0, 1], " + keys + " }\nball");
}

std::vector<Mistake> force_mistakes() {
  return {
      {"unknown object",
       with_torque("\"2*bop.position.x\""),
       {"model.toml:21", "forces.motor.torque", "character 3", "did you mean 'bob'"}},
      {"unknown quantity", with_torque("\"bob.positon.x\""), {"model.toml:21", "did you mean 'position'"}},
      {"vector", with_torque("\"bob.position\""), {"model.toml:21", "add .x, .y, .z or .norm"}},
      {"acceleration", with_torque("\"bob.acceleration.x\""), {"'bob' has no 'acceleration' for expressions"}},
      {"flexible", with_torque("\"bar.position.x\""), {"by markers on them", "'bar'"}},
      {"energy", with_torque("\"energy.total\""), {"no body, marker, joint, support or force 'energy'"}},
      {"unknown function",
       with_torque("\"sinn(t)\""),
       {"model.toml:21", "unknown function 'sinn'", "did you mean 'sin'"}},
      {"unknown name", with_torque("\"2*lenght\""), {"model.toml:21", "unknown name 'lenght'"}},
      {"quote", with_torque("\"'bob.position.x\""), {"the second ' is missing"}},
      {"circle", with_torque("\"motor.strength\""), {"forces.motor", "depends on itself: motor -> motor"}},
      {"circle of two",
       with_torque("\"sensors.a\"") + "[sensors]\na = \"2*motor.moment.z\"\n",
       {"depends on itself", "motor", "sensors.a"}},
      {"unknown sensor", with_torque("\"sensors.b\"") + "[sensors]\na = 1\n", {"'sensors' has no 'b'", "a"}},
      {"unknown input", with_torque("\"inputs.b\"") + "[inputs]\nbb = 1\n", {"did you mean 'bb'"}},
      {"input as text", with_torque("0") + "[inputs]\nb = \"t\"\n", {"inputs.b", "must be a number"}},
      {"infinite at the start", with_torque("\"1/bob.position.x\""), {"model.toml:21", "not a finite number at t = 0"}},
      {"nan derivative", with_torque("\"sqrt(bob.position.x)\""), {"derivative by bob.position.x"}},
      {"torque on a point",
       kModel + "[forces.f]\ntype = \"torque-motor\"\na = { body = \"ground\", axis = [0, 0, 1] }\nb = { body = "
                "\"dot\" }\ntorque = 1\n",
       {"forces.f", "needs a frame with axes"}},
      {"joint of a point",
       kModel +
           "[joints.g]\ntype = \"revolute\"\na = { body = \"ground\", axis = [0, 0, 1] }\nb = { body = \"dot\" }\n",
       {"joints.g", "needs a frame with axes"}},

      {"spline without points", kModel + "[splines.s]\nkind = \"akima\"\n", {"splines.s", "either 'file' or 'points'"}},
      {"one point", kModel + "[splines.s]\npoints = [[0, 1]]\n", {"splines.s", "at least two points"}},
      {"backwards", kModel + "[splines.s]\npoints = [[0, 1], [0, 2]]\n", {"splines.s", "must increase", "point 2"}},
      {"no pair", kModel + "[splines.s]\npoints = [[0, 1], [0]]\n", {"splines.s", "a point [x, y]"}},
      {"no file", kModel + "[splines.s]\nfile = \"nowhere.csv\"\n", {"splines.s", "nowhere.csv"}},
      {"name of a function",
       kModel + "[splines.sin]\npoints = [[0, 1], [1, 2]]\n",
       {"splines.sin", "taken by a function"}},
      {"outside",
       with_torque("\"s(bob.position.x + 3)\"") + "[splines.s]\npoints = [[0, 1], [1, 2]]\n",
       {"model.toml:21", "the spline 's' is asked for x = 3", "outside ="}},

      {"limits of a ball",
       kModel.substr(0, kModel.find("[integrator]")) +
           "slot = { type = \"spherical\", bodies = [\"ground\", \"bob\"], at = [0, 0, 0], limits = { lower = 0, "
           "stiffness = 1, smoothing = 1 } }\n" +
           kModel.substr(kModel.find("[integrator]")),
       {"joints.slot.limits", "only revolute, cylindrical, prismatic"}},
      {"empty range",
       with_hinge("limits = { lower = 1, upper = 0, stiffness = 1, smoothing = 1 }"),
       {"joints.hinge.limits.upper", "greater than 'lower'"}},
      {"no range",
       with_hinge("limits = { stiffness = 1, smoothing = 1 }"),
       {"joints.hinge.limits", "'lower' or 'upper'"}},
      {"no stiffness",
       with_hinge("limits = { upper = 1, smoothing = 1 }"),
       {"joints.hinge.limits", "needs 'stiffness'"}},
      {"friction without a pin",
       with_hinge("friction = { coefficient = 0.3, slip_speed = 1 }"),
       {"joints.hinge.friction", "needs 'radius'"}},
      {"friction without a speed",
       with_hinge("friction = { coefficient = 0.3, radius = 1 }"),
       {"joints.hinge.friction", "needs 'slip_speed'"}},
      {"negative friction",
       with_hinge("friction = { coefficient = -0.3, slip_speed = 1, radius = 1 }"),
       {"friction.coefficient", "must not be negative"}},
      {"static below dynamic",
       with_hinge("friction = { coefficient = 0.3, static = 0.2, slip_speed = 1, radius = 1 }"),
       {"friction.static", "not be below"}},
      {"key of friction",
       with_hinge("friction = { coefficient = 0.3, slip_speed = 1, radius = 1, torsion_arm = 1 }"),
       {"friction.torsion_arm", "unknown key"}},

      {"no comparison", with_event("when = \"t\""), {"events.bang.when", "one comparison"}},
      {"two comparisons", with_event("when = \"0 < t < 1\""), {"events.bang.when", "one comparison"}},
      {"half a comparison", with_event("when = \"t > \""), {"events.bang.when", "missing beside"}},
      {"no condition", with_event("stop = true"), {"events.bang", "needs 'when'"}},
      {"switch of nothing", with_event("when = \"t > 1\"\noff = [\"hing\"]"), {"events.bang", "did you mean 'hinge'"}},
      {"on and off",
       with_event("when = \"t > 1\"\noff = [\"hinge\"]\non = [\"hinge\"]"),
       {"events.bang", "on and off at once"}},
      {"set of nothing",
       with_event("when = \"t > 1\"\nset = { a = 1 }") + "[inputs]\nb = 1\n",
       {"events.bang.set.a", "unknown input 'a'"}},
      {"no steps", kModel + "steps = 0\n", {"model.toml:17", "at least 1"}},
  };
}

TEST(ForceMistakes, AreErrorsThatSayWhereAndWhat) {
  for (const Mistake& m : force_mistakes()) {
    Simulation s;
    const Status status = s.load_text(m.text, "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << m.name << ": " << status.message;
    for (const std::string& word : m.says)
      EXPECT_NE(status.message.find(word), std::string::npos) << m.name << ": " << status.message;
  }
}

}  // namespace
}  // namespace espalier::dynamics
