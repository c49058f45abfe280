// The joints of docs/guide/joints.md wherever joints go: restart files, derivatives by parameters, modes, equilibria,
// units, redundancy, switches. Truth: the run without a break, differences of whole runs, closed forms.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"
#include "espalier/sensitivities.hpp"

namespace espalier::dynamics {
namespace joint_everywhere_test {

struct Everywhere {
  std::string name, model, quantity;
};

std::string body_of(const std::string& name, const std::string& more) {
  return "[bodies." + name + "]\ntype = \"rigid\"\nmass = \"2*p\"\ninertia = [\"0.3*p\", 0.4, 0.5]\n" + more + "\n";
}

/// Each moves under a parameter p, some rounds or laps where it can.
const std::vector<Everywhere>& everywhere() {
  static const std::string kGround = "a = { body = \"ground\", axis = [0, 0, 1] }\nb = { body = \"b\" }\n";
  static const std::string kHead = "gravity = [1, 0, -10]\n[parameters]\np = 1\n";
  static const std::vector<Everywhere> cases = {
      {"screw",
       kHead + body_of("b", "") + "[joints.j]\ntype = \"screw\"\nlead = \"1.5*p\"\n" + kGround +
           "friction = { coefficient = 0.01, slip_speed = 0.1, radius = 0.1, viscous = 0.1 }\n",
       "j.angle"},
      {"constant-velocity",
       kHead + body_of("b", "position = [0, 0.1, -1]\nangular_velocity = [0, 1, 0]\nvelocity = [-1, 0, 0]") +
           "[joints.j]\ntype = \"constant-velocity\"\na = { body = \"ground\", axis = [0, 0, -1] }\nb = { body = "
           "\"b\", "
           "point = [0, -0.1, 1], axis = [0, 0.1, -1] }\n[initial]\nvelocities = \"project\"\n",
       "j.bend_angle"},
      {"parallel-axes",
       kHead + body_of("b", "angular_velocity = [0, 0, 20]") + "[joints.j]\ntype = \"parallel-axes\"\n" + kGround +
           "friction = { viscous = \"0.1*p\" }\n",
       "j.angle"},
      {"in-plane",
       kHead + body_of("b", "velocity = [0, 1, 0]") + "[joints.j]\ntype = \"in-plane\"\n" + kGround +
           "friction = { coefficient = \"0.05*p\", slip_speed = 0.1 }\n",
       "j.displacement_y"},
      {"in-line",
       kHead + body_of("b", "") + "[joints.j]\ntype = \"in-line\"\n" + kGround + "friction = { viscous = \"p\" }\n",
       "j.displacement"},
      {"point-on-curve",
       kHead + body_of("b", "velocity = [0, 6, 0]") +
           "[joints.j]\ntype = \"point-on-curve\"\nclosed = true\na = { body = \"ground\" }\nb = { body = "
           "\"b\" }\npoints = [[0, 0, 0], [0.4, 0.3, 0.1], [0, 0.7, 0], [-0.4, 0.3, \"0.2*p\"]]\nfriction = { "
           "viscous = 0.1 }\n[initial]\nvelocities = \"project\"\n",
       "j.displacement"},
      {"point-on-surface",
       kHead + body_of("b", "position = [1, 0, 0]\nvelocity = [0, 2, 0]") +
           "[joints.j]\ntype = \"point-on-surface\"\na = { body = \"ground\" }\nb = { body = \"b\" "
           "}\nshape = \"ellipsoid\"\nhalf_axes = [1, \"1.2*p\", 1.4]\n",
       "b.position.z"},
      {"gear-pair",
       kHead + body_of("b", "angular_velocity = [0, 0, 30]") +
           "[bodies.c]\ntype = \"rigid\"\nmass = 1\ninertia = [1, 1, 1]\nposition = [0.5, 0, 0]\n[joints.one]\ntype = "
           "\"revolute\"\nbodies = [\"ground\", \"b\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n[joints.two]\ntype = "
           "\"revolute\"\nbodies = [\"ground\", \"c\"]\nat = [0.5, 0, 0]\naxis = [0, 0, 1]\n[joints.j]\ntype = "
           "\"gear-pair\"\nteeth = [20, \"30*p\"]\na = { body = \"b\", axis = [0, 0, 1] }\nb = { body = \"c\" "
           "}\n[initial]\nvelocities = \"project\"\n",
       "two.angle"},
      {"rack-pair",
       kHead + body_of("b", "position = [0, 0, 0.3]") +
           "[bodies.c]\ntype = \"rigid\"\nmass = \"p\"\ninertia = [1, 1, 1]\n[joints.one]\ntype = "
           "\"revolute\"\nbodies = [\"ground\", \"b\"]\nat = [0, 0, 0.3]\naxis = [0, 1, 0]\n[joints.two]\ntype = "
           "\"prismatic\"\nbodies = [\"ground\", \"c\"]\nat = [0, 0, 0]\naxis = [1, 0, 0]\n[joints.j]\ntype = "
           "\"rack-pair\"\na = { body = \"c\", axis = [1, 0, 0] }\nb = { body = \"b\", axis = [0, 1, 0] }\n",
       "one.angle"},
      {"worm",
       kHead + body_of("b", "angular_velocity = [40, 0, 0]") +
           "[bodies.c]\ntype = \"rigid\"\nmass = 1\ninertia = [1, 1, 1]\nposition = [0, 0, 0.5]\n[joints.one]\ntype = "
           "\"revolute\"\nbodies = [\"ground\", \"b\"]\nat = [0, 0, 0]\naxis = [1, 0, 0]\n[joints.two]\ntype = "
           "\"revolute\"\nbodies = [\"ground\", \"c\"]\nat = [0, 0, 0.5]\naxis = [0, 1, 0]\n[joints.j]\ntype = "
           "\"worm\"\nlead = \"0.2*p\"\nradius = 0.4\na = { body = \"b\", axis = [1, 0, 0] }\nb = { body = \"c\", axis "
           "= [0, "
           "1, 0] }\nfriction = { viscous = 0.3 }\n[initial]\nvelocities = \"project\"\n",
       "two.angle"},
      {"cable",
       kHead + body_of("b", "position = [0, 0, -1]") +
           "[bodies.c]\ntype = \"point\"\nmass = 1\nposition = [1, 0, -1]\n[joints.j]\ntype = \"cable\"\nthrough = "
           "[\"b\", { body = \"ground\", point = [0.2, 0, 0] }, { body = \"ground\", point = [0.8, 0, 0] }, \"c\"]\n",
       "c.position.z"},
      {"elastic cable",
       kHead + body_of("b", "position = [0, 0, -1]") +
           "[bodies.c]\ntype = \"point\"\nmass = 1\nposition = [1, 0, -1]\n[forces.j]\ntype = \"cable\"\n"
           "stiffness = \"900*p\"\nfriction = 0.1\nslip_speed = 1\ndamping = 5\nthrough = [\"b\", { body = "
           "\"ground\", point = [0.2, 0, 0] }, { body = \"ground\", point = [0.8, 0, 0] }, \"c\"]\n",
       "j.length"}};
  return cases;
}

TEST(JointsEverywhere, RestartsGoOnToTheSameBits) {
  for (const Everywhere& c : everywhere()) {
    const std::string text =
        c.model + "[integrator]\nend = 0.5\n[output]\npage = false\nrestart_interval = 0.1\nquantities = [\"" +
        c.quantity + "\"]\n";
    const ScratchFolder whole, broken;
    SimulationOptions options;
    options.out = whole.path();
    const Simulation run = simulated(text, options);
    options.out = broken.path();
    Simulation first(options);
    ASSERT_TRUE(first.load_text(text, "model.toml").ok()) << c.name;
    ASSERT_TRUE(first.run([](const SimulationStep& step) { return step.t < 0.2; }).ok()) << c.name;
    EXPECT_TRUE(first.summary().interrupted) << c.name;
    options.restart = broken.path() + "/state.restart";
    const Simulation second = simulated(text, options);
    EXPECT_EQ(second.value(c.quantity), run.value(c.quantity)) << c.name;
    EXPECT_EQ(second.summary().steps, run.summary().steps) << c.name;
    EXPECT_GT(std::abs(run.value(c.quantity)), 1e-3) << c.name;
  }
}

TEST(JointsEverywhere, DerivativesAreThoseOfDifferences) {
  for (const Everywhere& c : everywhere()) {
    const std::string text =
        c.model +
        "[integrator]\nrelative = 1e-9\nabsolute = 1e-11\nend = 0.4\n[output]\npage = false\nquantities = [\"" +
        c.quantity + "\"]\n";
    const SensitivityResult r = sensitivities_of_text(text, "model.toml", {{"parameters.p"}}, {});
    ASSERT_TRUE(r.status.ok()) << c.name << ": " << r.status.message;
    const auto at = [&](double p) {
      return simulated(replaced(text, "p = 1\n", fmt::format("p = {:.17g}\n", p))).value(c.quantity);
    };
    const double h = 2e-3, slope = (8 * (at(1 + h) - at(1 - h)) - (at(1 + 2 * h) - at(1 - 2 * h))) / (12 * h);
    EXPECT_NEAR(r.derivative(c.quantity, "parameters.p"), slope, 2e-5 * (1 + std::abs(slope))) << c.name;
  }
}

TEST(JointsEverywhere, IntegratorsAgree) {
  for (const Everywhere& c : everywhere()) {
    const Simulation bdf = simulated(c.model + "[integrator]\nrelative = 1e-9\nabsolute = 1e-11\nend = 0.3\n");
    const Simulation full = simulated(
        c.model + "[integrator]\nrelative = 1e-8\nabsolute = 1e-10\nend = 0.3\niteration = \"full-tangent\"\n");
    const Simulation alpha =
        simulated(c.model + "[integrator]\nmethod = \"generalized-alpha\"\nstep = 5e-4\nend = 0.3\n");
    const double value = bdf.value(c.quantity), size = 1 + std::abs(value);
    EXPECT_NEAR(full.value(c.quantity), value, 1e-6 * size) << c.name;
    EXPECT_NEAR(alpha.value(c.quantity), value, 2e-4 * size) << c.name;
    EXPECT_LT(bdf.summary().largest_violation.position, 1e-8) << c.name;
  }
}

TEST(JointsEverywhere, ModesAboutAnEquilibrium) {
  // In the bowl z = 2 x^2 + y^2 a mass swings with sqrt(4 g) and sqrt(2 g); on the curve z = 2 x^2 with sqrt(4 g).
  const std::string head =
      "gravity = [0, 0, -10]\n[bodies.m]\ntype = \"point\"\nmass = 3\nposition = [0, 0, 0]\n[joints.j]\na "
      "= { body = \"ground\" }\nb = { body = \"m\" }\n";
  std::string points, grid;
  for (int k = -40; k <= 40; ++k) points += fmt::format("[{}, 0, {}], ", 0.01 * k, 2e-4 * k * k);
  for (int k = -4; k <= 4; ++k) {
    grid += "[";
    for (int i = -4; i <= 4; ++i) grid += fmt::format("{}, ", 0.02 * k * k + 0.01 * i * i);
    grid += "], ";
  }
  const std::string line = "[-0.4, -0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3, 0.4]";
  const Simulation curve = simulated(head + "type = \"point-on-curve\"\nends = \"straight\"\npoints = [" + points +
                                     "]\n[initial]\nmodes = 1\n[integrator]\nend = 1e-3\n");
  EXPECT_NEAR(curve.summary().modes.at(0).frequency, std::sqrt(40.0) / (2 * std::numbers::pi),
              1e-3);  // its curvature: h^2
  const Simulation bowl =
      simulated(head + "type = \"point-on-surface\"\nshape = \"heights\"\nx = " + line + "\ny = " + line +
                "\nheights = [" + grid + "]\n[initial]\nmodes = 2\n[integrator]\nend = 1e-3\n");
  EXPECT_NEAR(bowl.summary().modes.at(0).frequency, std::sqrt(20.0) / (2 * std::numbers::pi), 1e-6);
  EXPECT_NEAR(bowl.summary().modes.at(1).frequency, std::sqrt(40.0) / (2 * std::numbers::pi), 1e-6);
  // Equilibrium on the curve under a pull of 6 along x: 12 g x = 6.
  const Simulation rest =
      simulated(head + "type = \"point-on-curve\"\nends = \"straight\"\npoints = [" + points +
                "]\n[forces.pull]\ntype = \"load\"\na = { body = \"m\" }\nforce = [6, 0, 0]\n[statics]\n");
  EXPECT_NEAR(rest.value("m.position.x"), 6 / 120.0, 1e-5);
}

TEST(JointsEverywhere, UnitsAndFilesAreRead) {
  const ScratchFolder folder;
  std::ofstream(folder.path() + "/wire.csv") << "x,y,z\n# a comment\n0, 0, 0\n100;0;0\n\n200\t0\t0\n";
  std::ofstream(folder.path() + "/bad.csv") << "0, 0, 0\n1, 2\n";
  const std::string model =
      "units = \"SI\"\ngravity = [10, 0, 0]\n[bodies.m]\ntype = \"point\"\nmass = \"2000 g\"\n"
      "[joints.j]\ntype = \"point-on-curve\"\na = { body = \"ground\" }\nb = { body = \"m\" }\nfile = "
      "\"wire.csv\"\nscale = 1e-3\nlimits = { stiffness = \"100 N/mm\", smoothing = \"1 um\" }\nfriction = { "
      "viscous = \"30 N*s/m\" }\n[integrator]\nend = 5\n";
  const std::string path = folder.path() + "/model.toml";
  std::ofstream(path) << model;
  Simulation s;
  Status status = s.load(path);
  if (status.ok()) status = s.run();
  ASSERT_TRUE(status.ok()) << status.message;
  EXPECT_NEAR(s.value("j.displacement"), 0.2, 1e-3);
  std::ofstream(path) << replaced(model, "wire.csv", "bad.csv");
  Simulation bad;
  status = bad.load(path);
  EXPECT_NE(status.message.find("bad.csv:2"), std::string::npos) << status.message;
  const Simulation lead = simulated(
      "units = \"SI\"\ngravity = [0, 0, 0]\n[bodies.b]\ntype = \"rigid\"\nmass = 1\ninertia = [1, 1, "
      "1]\nangular_velocity = [0, 0, 10]\n[joints.j]\ntype = \"screw\"\nbodies = [\"ground\", "
      "\"b\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\nlead = \"5 mm\"\n[initial]\nvelocities = "
      "\"project\"\n[integrator]\nend = 1\n");
  EXPECT_NEAR(lead.value("j.displacement"), 0.005 / (2 * std::numbers::pi) * lead.value("j.angle"), 1e-10);
}

TEST(JointsEverywhere, RedundantOnesAreNamedAndCoupledOnesSwitched) {
  // A bead on a curve in a plane that it is held in anyway.
  const std::string head = "gravity = [0, 0, -10]\n[bodies.m]\ntype = \"rigid\"\nmass = 3\ninertia = [1, 1, 1]\n";
  const Simulation s =
      simulated(head +
                "[joints.flat]\ntype = \"planar\"\nbodies = [\"ground\", \"m\"]\nat = [0, 0, 0]\naxis = [0, 1, "
                "0]\n[joints.wire]\ntype = \"point-on-curve\"\na = { body = \"ground\" }\nb = { body = \"m\" "
                "}\nends = \"straight\"\npoints = [[-1, 0, 1], [0, 0, 0], [1, 0, 1]]\n[integrator]\nend = 0.1\n");
  ASSERT_EQ(s.summary().redundant.size(), 1U);
  EXPECT_NE(s.summary().redundant[0].find("direction across the curve"), std::string::npos) << s.summary().redundant[0];
  EXPECT_EQ(s.summary().degrees_of_freedom, 2);
  // A gear pair that is engaged later, at whatever angle, as two wheels of one speed: a plastic impact.
  const Simulation gears = simulated(
      "gravity = [0, 0, 0]\n" + replaced(head.substr(head.find("[bodies")), "bodies.m", "bodies.a") +
      "angular_velocity = [0, 0, "
      "6]\n" +
      replaced(head.substr(head.find("[bodies")), "bodies.m", "bodies.b") +
      "position = [1, 0, 0]\n[joints.one]\ntype = \"revolute\"\nbodies = [\"ground\", \"a\"]\nat = [0, 0, 0]\naxis = "
      "[0, 0, "
      "1]\n[joints.two]\ntype = \"revolute\"\nbodies = [\"ground\", \"b\"]\nat = [1, 0, 0]\naxis = [0, 0, "
      "1]\n[joints.mesh]\ntype "
      "= \"gear-pair\"\na = { body = \"a\", axis = [0, 0, 1] }\nb = { body = \"b\" }\nteeth = [10, 20]\nactive = "
      "false\n[events.engage]\nwhen = \"t > 0.5\"\non = [\"mesh\"]\nonce = true\n[integrator]\nend = 1\n");
  const double speed = 6 / (1 + 0.25);  // J (w - w_0) + J / 4 w = 0
  EXPECT_NEAR(gears.value("one.angular_speed"), speed, 1e-6);
  EXPECT_NEAR(gears.value("two.angular_speed"), -speed / 2, 1e-6);
}

TEST(JointsEverywhere, ACableThatIsSwitchedOnHasTheLengthGiven) {
  const auto message = [](const std::string& length) {
    Simulation s;
    Status status = s.load_text(
        "gravity = [0, 0, -10]\n[bodies]\nheavy = { type = \"point\", mass = 5, position = [0, 0, -1] }\nlight = { "
        "type = "
        "\"point\", mass = 3, position = [0.5, 0, -1] }\n[joints.rope]\ntype = \"cable\"\nactive = false\nthrough = "
        "[\"heavy\", { body = \"ground\" }, { body = \"ground\", point = [0.5, 0, 0] }, \"light\"]\nlength = " +
            length + "\n[events.engage]\nwhen = \"t > 0.1\"\non = [\"rope\"]\nonce = true\n[integrator]\nend = 0.2\n",
        "model.toml");
    if (status.ok()) status = s.run();
    if (status.ok()) {
      EXPECT_NEAR(s.value("heavy.position.z") + s.value("light.position.z"), -2.1, 1e-6);
    }
    return status.message;
  };
  EXPECT_EQ(message("\"initial\""), "");  // both have fallen by 0.05
  EXPECT_EQ(message("2.6"), "");
  EXPECT_NE(message("2.7").find("contradict the constraints"), std::string::npos);
}

TEST(JointsEverywhere, FlexibleBodiesAreHeldWhereTheyAre) {
  // A curve and a surface on the edge of a plate, 0.01 beside the bead: the frame of the plate moves, not the plate.
  const std::string plate =
      "gravity = [0, 0, -10]\n[bodies.plate]\ntype = \"shell\"\nx = [1, 0, 0]\ny = [0, 1, 0]\nnx = 2\nny = "
      "2\nthickness = "
      "0.02\nmaterial = { young = 1e8, density = 500 }\n[supports]\nclamp = { body = \"plate\", edge = \"x0\", hold = "
      "\"all\" "
      "}\n[bodies.bead]\ntype = \"point\"\nmass = 2\nposition = [1, 0.5, 0]\n[joints.j]\na = { body = \"plate\", edge "
      "= "
      "\"x1\", attach = \"mean\" }\nb = { body = \"bead\" }\n";
  for (const std::string joint :
       {"type = \"point-on-curve\"\nends = \"straight\"\npoints = [[0, -0.5, 0], [0, 0, 0.01], [0, 0.5, 0]]\n",
        "type = \"point-on-surface\"\nshape = \"heights\"\nx = [-1, 1]\ny = [-1, 1]\nheights = [[0.01, 0.01], [0.01, "
        "0.01]]\n"}) {
    const Simulation s = simulated(plate + joint + "[integrator]\nend = 1e-3\n");
    std::string notices;
    for (const std::string& notice : s.summary().notices) notices += notice;
    EXPECT_NE(notices.find("holds the edge of 'plate' where it is; the frames of the joint were 0.01 apart"),
              std::string::npos)
        << notices;
    EXPECT_NEAR(s.value("bead.position.z"), 0, 1e-4);
    EXPECT_LT(s.summary().energy_begin.kinetic + std::abs(s.summary().energy_begin.potential), 1e-6);
  }
}

TEST(JointsEverywhere, PageShowsThem) {
  const ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  for (const Everywhere& c : everywhere()) {
    static_cast<void>(simulated(c.model + "[integrator]\nend = 0.01\n[output]\nvtu_interval = 0\n", options));
    EXPECT_NE(content_of(folder.path() + "/index.html").find("<html"), std::string::npos) << c.name;
  }
}

}  // namespace joint_everywhere_test
}  // namespace espalier::dynamics
