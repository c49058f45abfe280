// Statics of small displacements. Truths: beam theory, closed forms, a dense solve of the exported equations, the slope
// of the path of equilibria at its beginning.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "dynamics/integrators/linearised.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace linear_statics_test {

const std::string kLinear = "[statics]\nlinear = true\n";

/// A cantilever of steel along x in any unit of length, without a density: E I = 175, k G A = 6.6e6 for a unit of 1.
std::string linear_beam(const std::string& loads, double unit = 1, const std::string& statics = kLinear) {
  return fmt::format(R"([parameters]
u = {}
[bodies.rod]
type = "beam"
start = [0, 0, 0]
end = ["u", 0, 0]
elements = 8
height = "0.01*u"
width = "0.01*u"
material = {{ young = "2.1e11/u^2", poisson = 0.3 }}
[joints.wall]
type = "fixed"
a = {{ body = "ground" }}
b = {{ body = "rod", node = 1 }}
[markers]
tip = {{ body = "rod", node = -1 }}
[forces]
{}
{})",
                     unit, loads, statics);
}

std::string failure_of(const std::string& text) {
  Simulation s;
  Status status = s.load_text(text, "model.toml");
  if (status.ok()) status = s.run();
  EXPECT_FALSE(status.ok()) << text;
  return status.message;
}

/// P L^3 / (3 E I) + P L / (k G A), with forces of any size: nothing but the load's factor changes.
TEST(LinearStatics, OfACantileverIsBeamTheory) {
  const double e = 2.1e11, i = 1e-8 / 12, g = e / 2.6, k = 10 * 1.3 / (12 + 11 * 0.3);
  const double per_newton = 1 / (3 * e * i) + 1 / (k * g * 1e-4);
  for (const double unit : {1.0, 1e3, 1e-3})
    for (const double force : {1e-6, 1.0, 1e9}) {
      const Simulation s = simulated(
          linear_beam(fmt::format("p = {{ type = \"load\", a = \"tip\", force = [0, 0, {}] }}", force), unit));
      EXPECT_NEAR(s.value("tip.position.z"), force * per_newton * unit, 1e-6 * force * per_newton * unit);
      EXPECT_NEAR(s.value("tip.rotation.y"), -force / (2 * e * i), 1e-6 * force / (2 * e * i));
      EXPECT_NEAR(s.value("tip.position.x"), unit, 1e-12 * unit);  // nothing of second order
      EXPECT_NEAR(s.value("wall.force.z"), -force, 1e-9 * force);
      EXPECT_NEAR(s.value("wall.moment.y"), force * unit, 1e-9 * force * unit);
      EXPECT_NEAR(s.value("energy.potential"), 0.5 * force * force * per_newton * unit,
                  1e-6 * force * force * per_newton * unit);
      EXPECT_EQ(s.summary().method, "linear statics");
      EXPECT_LT(s.summary().statics_backward_error, 1e-14);
      EXPECT_EQ(s.summary().steps, 1);
    }
}

// Answers of two loads are the sum of those of each; the load factor is one on all of it.
TEST(LinearStatics, AnswersAddUp) {
  const std::string
      first = "p = { type = \"load\", a = \"tip\", force = [3, 0, 50] }\n",
      second = "q = { type = \"load\", a = { body = \"rod\", node = 4 }, force = [0, 20, 0], moment = [1, 2, 3] }\n";
  const Simulation a = simulated(linear_beam(first)), b = simulated(linear_beam(second)),
                   both = simulated(linear_beam(first + second)),
                   more = simulated(linear_beam(first + second, 1, kLinear + "load = 7e4\n"));
  const Simulation rest = simulated(linear_beam(""));
  for (const char* q : {"tip.position.x", "tip.position.y", "tip.position.z", "tip.rotation.x", "tip.rotation.z",
                        "wall.force.x", "wall.force.y", "wall.moment.x", "wall.moment.z"}) {
    const bool force = std::string(q).starts_with("wall");
    const double tiny = force ? 1e-9 : 1e-12;  // of what else there is
    const double zero = rest.value(q), sum = a.value(q) + b.value(q) - 2 * zero;
    EXPECT_NEAR(both.value(q) - zero, sum, 1e-9 * std::abs(sum) + tiny) << q;
    EXPECT_NEAR(more.value(q) - zero, 7e4 * sum, 7e4 * (1e-9 * std::abs(sum) + tiny)) << q;
  }
  EXPECT_EQ(rest.value("wall.force.z"), 0);
  EXPECT_TRUE(std::any_of(more.summary().notices.begin(), more.summary().notices.end(),
                          [](const std::string& n) { return n.find("takes displacements as small") != n.npos; }));
}

/// A frame of a solid with a rigid body on a face, loops and a spring.
const std::string kFrame = R"([bodies.block]
type = "solid"
mesh = { part = "block", lx = 0.3, ly = 0.05, lz = 0.04, divisions = [4, 1, 1] }
material = { young = 7e10, poisson = 0.3 }
[bodies.hub]
type = "rigid"
mass = 2
box = [0.1, 0.1, 0.1]
position = [0.4, 0.02, 0.02]
[joints.wall]
type = "fixed"
a = { body = "ground" }
b = { body = "block", face = "x0" }
[joints.pin]
type = "revolute"
a = { body = "hub", point = [-0.1, 0, 0], axis = [0, 1, 0] }
b = { body = "block", face = "x1", attach = "mean" }
[joints.rail]
type = "point-on-line"
a = { body = "ground", point = [0.5, 0.02, 0.02], axis = [1, 0, 1] }
b = { body = "hub", point = [0.1, 0, 0] }
[forces.spring]
type = "spring"
a = { body = "ground", point = [0.4, 0.5, 0.3] }
b = { body = "hub", point = [0, 0.05, 0] }
stiffness = 1e5
preload = 30
[forces.push]
type = "load"
a = { body = "hub" }
force = [100, -200, 300]
moment = [4, 5, 6]
follower = true
)";

// A second solver: the linearised equations, dense, with what is out of balance from the residual itself.
TEST(LinearStatics, IsTheSolutionOfTheExportedEquations) {
  const auto mechanism = built(kFrame + kLinear);
  State s(mechanism->system.sizes());
  mechanism->system.initial(s.q, s.v);
  std::fill(s.v.begin(), s.v.end(), 0.0);
  Equations equations(mechanism->system);
  std::vector<double> f(s.v.size());
  equations.evaluate_constraints(0, s.q, {});
  equations.motion(s.view(), f);
  mechanism->system.set_load_factor(0);
  const Linearised a = linearise(equations, s);
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(a.size(), a.size());
  for (Index c = 0; c < a.size(); ++c)
    for (auto e = static_cast<std::size_t>(a.stiffness.col_ptr[static_cast<std::size_t>(c)]);
         e < static_cast<std::size_t>(a.stiffness.col_ptr[static_cast<std::size_t>(c) + 1]); ++e)
      k(a.stiffness.row_ind[e], c) += a.stiffness.values[e];
  Eigen::VectorXd right = Eigen::VectorXd::Zero(a.size());
  for (std::size_t i = 0; i < f.size(); ++i) right[static_cast<Eigen::Index>(i)] = -f[i];
  for (std::size_t r = 0; r < a.rows.size(); ++r)
    right[a.n + static_cast<Eigen::Index>(r)] = -equations.phi()[static_cast<std::size_t>(a.rows[r])];
  const double stiff = 1e9;  // rows and multipliers as large as the rest
  k.bottomRows(a.size() - a.n) *= stiff;
  k.rightCols(a.size() - a.n) *= stiff;
  right.tail(a.size() - a.n) *= stiff;
  const Eigen::VectorXd x = k.partialPivLu().solve(right);
  const Simulation run = simulated(kFrame + kLinear);
  ASSERT_TRUE(run.summary().redundant.empty());
  const Eigen::Index hub = mechanism->body("hub")->rigid->coordinates()[0];
  const double at_rest[3] = {0.4, 0.02, 0.02};
  for (int i = 0; i < 3; ++i) {
    const std::string axis(1, "xyz"[i]);
    EXPECT_NEAR(run.value("hub.position." + axis) - at_rest[i], x[hub + i], 1e-9 * x.segment<3>(hub).norm()) << axis;
    EXPECT_NEAR(run.value("hub.rotation." + axis), x[hub + 3 + i], 1e-8 * x.segment<3>(hub + 3).norm()) << axis;
  }
  // Reactions hold the loads, the preload and the spring.
  Eigen::Vector3d sum(100, -200, 300);
  for (const char* force : {"wall.force", "rail.force", "spring.force"})
    for (int i = 0; i < 3; ++i) sum[i] += run.value(fmt::format("{}.{}", force, "xyz"[i]));
  EXPECT_LT(sum.norm(), 1e-6 * 400);
}

// The slope of the path at its beginning: followers, pressures and a spring of an expression.
TEST(LinearStatics, IsTheBeginningOfThePath) {
  const std::string text = R"([bodies.block]
type = "solid"
mesh = { part = "block", lx = 0.5, ly = 0.05, lz = 0.02, divisions = [5, 1, 2] }
material = { young = 7e10, poisson = 0.3, density = 2700 }
[joints.wall]
type = "fixed"
a = { body = "ground" }
b = { body = "block", face = "x0" }
[markers]
tip = { body = "block", face = "x1" }
[forces.wind]
type = "pressure"
body = "block"
face = "z1"
pressure = 1e4
[forces.push]
type = "load"
a = { body = "block", face = "x1" }
force = [0, 0, 40]
follower = true
[forces.law]
type = "load"
a = { body = "block", face = "x1" }
force = ["0", "0", "-3e4*tip.position.z + 300"]
[statics]
)";
  const Simulation linear = simulated(text + "linear = true\n");
  // Forces of an expression are as stiff as they are; at a small load factor hardly: this one is compared without it.
  const std::string off = "-3e4*tip.position.z + 300", constant = "300 - 3e4*0.01";
  const Simulation constant_linear = simulated(replaced(text, off, constant) + "linear = true\n"),
                   constant_path = simulated(replaced(text, off, constant) + "load = 1e-4\ntolerance = 1e-12\n");
  for (const char* q : {"tip.position.x", "tip.position.z", "tip.rotation.y", "wall.force.z", "wall.moment.y"}) {
    const std::string name = q;
    const double rest = name == "tip.position.x" ? 0.5 : name == "tip.position.z" ? 0.01 : 0;
    const double slope = (constant_path.value(q) - rest) / 1e-4, found = constant_linear.value(q) - rest;
    EXPECT_NEAR(found, slope, 2e-4 * std::abs(slope) + (name == "tip.position.x" ? 2e-6 : 0)) << q;
  }
  // With the spring: u = c (p + 300 - 3e4 (0.01 + u)) for the deflection c of one newton, p the rest of the loads.
  const double without = constant_linear.value("tip.position.z") - 0.01, with = linear.value("tip.position.z") - 0.01;
  const double one = simulated(replaced(replaced(text, off, "1"), "pressure = 1e4", "pressure = 0") + "linear = true\n")
                         .value("tip.position.z") -
                     0.01;
  const double push =
      simulated(replaced(replaced(text, off, "0"), "pressure = 1e4", "pressure = 0") + "linear = true\n")
          .value("tip.position.z") -
      0.01;
  EXPECT_NEAR(with, without / (1 + 3e4 * (one - push)), 1e-7 * std::abs(with));
}

// A bar under tension: Cauchy, Piola and engineering stress are one, P / A, at a stretch of any size; the same in a
// neo-Hookean material.
TEST(LinearStatics, StressesGoWithTheLoad) {
  for (const char* law : {"st-venant-kirchhoff", "neo-hookean"})
    for (const double force : {1e-3, 1e3, 1e9}) {
      SimulationOptions options;
      options.quantities = {"tip.position.x"};
      const Simulation s = simulated(
          fmt::format(
              "[bodies.bar]\ntype = \"solid\"\nmesh = {{ part = \"block\", lx = 1, ly = 0.1, lz = 0.1, divisions = "
              "[4, 1, 1] }}\nmaterial = {{ law = \"{}\", young = 2e11, poisson = 0.3 }}\n[markers]\ntip = {{ body "
              "= \"bar\", face = \"x1\" }}\n[supports]\na = {{ body = \"bar\", face = \"x0\", hold = \"x\" }}\nb = "
              "{{ body = \"bar\", face = \"y0\", hold = \"y\" }}\nc = {{ body = \"bar\", face = \"z0\", hold = "
              "\"z\" }}\n[forces]\np = {{ type = \"load\", a = \"tip\", force = [{}, 0, 0] }}\n[statics]\nlinear = "
              "true\n",
              law, force),
          options);
      EXPECT_NEAR(s.value("tip.position.x") - 1, force / 2e9, 1e-9 * force / 2e9 + 2e-16);
      const SimulationFrame frame = s.frame();
      ASSERT_EQ(frame.von_mises.size(), 4U);
      for (const double stress : frame.von_mises) EXPECT_NEAR(stress, force / 0.01, 1e-7 * force / 0.01) << law;
      EXPECT_NEAR(s.value("a.force.x"), -force, 1e-9 * force);
    }
}

// A mass between two strings under tension T is held sidewards by 2 T / L, at the start: prestress is stiff as it is
// there.
TEST(LinearStatics, PrestressIsStiff) {
  const Simulation s = simulated(R"([bodies.bead]
type = "point"
mass = 1
velocity = [3, 1, 4]
[forces.left]
type = "spring"
a = { body = "ground", point = [-2, 0, 0] }
b = { body = "bead" }
stiffness = 1000
preload = 50
[forces.right]
type = "spring"
a = { body = "ground", point = [2, 0, 0] }
b = { body = "bead" }
stiffness = 1000
preload = 50
[forces.push]
type = "load"
a = { body = "bead" }
force = [10, 5, 0]
)" + kLinear);
  EXPECT_NEAR(s.value("bead.position.x"), 10.0 / 2000, 1e-12);
  EXPECT_NEAR(s.value("bead.position.y"), 5.0 / 50, 1e-12);
}

// Supports that a rigid table has too many of, on its own and prescribed; a joint that does not fit is closed.
TEST(LinearStatics, SharesReactionsAndClosesJoints) {
  std::string text = "gravity = [0, 0, -10]\n[bodies.top]\ntype = \"rigid\"\nmass = 8\ninertia = [1, 1, 1]\n";
  const double legs[4][2] = {{0.6, 0.4}, {-0.6, 0.4}, {-0.6, -0.4}, {0.6, -0.4}};
  for (int k = 0; k < 4; ++k)
    text += fmt::format(
        "[joints.leg{}]\ntype = \"prescribed\"\na = {{ body = \"ground\", point = [{}, {}, 0] }}\nb = {{ body = "
        "\"top\", "
        "point = [{}, {}, 0] }}\nmotion = \"{}\"\ndirection = \"z\"\n",
        k, legs[k][0], legs[k][1], legs[k][0], legs[k][1], "1e-3");
  text += "[joints.rail]\ntype = \"prismatic\"\nbodies = [\"ground\", \"top\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n";
  const Simulation s = simulated(text + kLinear);
  for (int k = 0; k < 4; ++k) EXPECT_NEAR(s.value(fmt::format("leg{}.force.z", k)), 20, 1e-8);
  EXPECT_NEAR(s.value("top.position.z"), 1e-3, 1e-12);
  const std::string refused = failure_of(replaced(text, "motion = \"1e-3\"", "motion = \"2e-3\"") + kLinear);
  EXPECT_NE(refused.find("contradicts"), std::string::npos) << refused;
}

TEST(LinearStatics, RefusesWhatIsNotHeld) {
  const std::string body = "[bodies.bob]\ntype = \"rigid\"\nmass = 1\nbox = [1, 1, 1]\nposition = [0.5, 0, 0]\n";
  const std::string turning = failure_of(
      body + "[joints.pin]\ntype = \"revolute\"\nbodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\naxis = [0, 1, 0]\n" +
      kLinear);
  EXPECT_NE(turning.find("'bob' can turn about y"), std::string::npos) << turning;
  const std::string flexible = failure_of(
      "[bodies.bar]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 1, ly = 0.1, lz = 0.1, divisions = [3, 1, 1] }\n"
      "material = { young = 2e11 }\n[supports]\nwall = { body = \"bar\", face = \"x0\", hold = \"xy\" }\n" +
      kLinear);
  EXPECT_NE(flexible.find("'bar' can move along z"), std::string::npos) << flexible;
  const std::string shell = failure_of(
      "[bodies.roof]\ntype = \"shell\"\nx = [1, 0, 0]\ny = [0, 0.1, 0]\nnx = 9\nny = 2\nthickness = 1e-3\nmaterial = { "
      "young = 2e11, "
      "poisson = 0.3 }\n[supports]\nwall = { body = \"roof\", edge = \"x0\", hold = \"xyz\" }\n" +
      kLinear);
  EXPECT_NE(shell.find("'roof' can turn about y"), std::string::npos) << shell;
  // A cable without bending stiffness between two pins: no body as a whole can move.
  const std::string slack = failure_of(
      "[bodies.rope]\ntype = \"cable\"\nstart = [0, 0, 0]\nend = [1, 0, 0]\nelements = 4\naxial = 1e5\nbending = 0\n"
      "[supports]\na = { body = \"rope\", node = 1, hold = \"xyz\" }\nb = { body = \"rope\", node = -1, hold = \"xyz\" "
      "}\n"
      "[forces]\np = { type = \"load\", a = { body = \"rope\", node = 3 }, force = [0, 0, 1] }\n" +
      kLinear);
  EXPECT_NE(slack.find("is not held"), std::string::npos) << slack;
  EXPECT_NE(slack.find("rope"), std::string::npos) << slack;
}

// A strip of shells bends by F L^3 / (3 E I), the thinner the more; what rounding takes of that is said, and no number
// is shown where it is most of it. A thin beam has no such trouble.
TEST(LinearStatics, KnowsWhatRoundingTakes) {
  const auto strip = [](const char* thickness) {
    return fmt::format(
               "[parameters]\nh = {}\n[bodies.s]\ntype = \"shell\"\nx = [1, 0, 0]\ny = [0, 1, 0]\nnx = 20\nny = "
               "2\nthickness = "
               "\"h\"\nmaterial = {{ young = 12, poisson = 0 }}\n[supports]\nwall = {{ body = \"s\", edge = \"x0\", "
               "hold = "
               "\"all\" }}\n[markers]\ntip = {{ body = \"s\", edge = \"x1\" }}\n[forces]\np = {{ type = \"load\", a = "
               "\"tip\", "
               "force = [0, 0, \"3*h^3\"] }}\n",
               thickness) +
           kLinear;
  };
  const auto warned = [](const Simulation& s) {
    const auto& notices = s.summary().notices;
    return std::any_of(notices.begin(), notices.end(),
                       [](const std::string& n) { return n.find("rounding in the stiffness") != n.npos; });
  };
  const Simulation thick = simulated(strip("1e-2")), thin = simulated(strip("1e-3"));
  EXPECT_NEAR(thick.value("tip.position.z"), 1, 2e-3);
  EXPECT_NEAR(thin.value("tip.position.z"), 1, 2e-3);
  EXPECT_FALSE(warned(thick));
  EXPECT_TRUE(warned(thin));
  const std::string refused = failure_of(strip("1e-5"));
  EXPECT_NE(refused.find("very thin for its size"), std::string::npos) << refused;
  const Simulation beam = simulated(
      "[bodies.b]\ntype = \"beam\"\nstart = [0, 0, 0]\nend = [1, 0, 0]\nelements = 20\nheight = 1e-4\nwidth = "
      "1e-4\nmaterial = { "
      "young = 12, poisson = 0 }\n[joints]\nwall = { type = \"fixed\", a = { body = \"ground\" }, b = { body = \"b\", "
      "node = 1 } "
      "}\n[markers]\ntip = { body = \"b\", node = -1 }\n[forces]\np = { type = \"load\", a = \"tip\", force = [0, 0, "
      "3e-16] }\n" +
      kLinear);
  EXPECT_NEAR(beam.value("tip.position.z"), 1, 1e-6);
  EXPECT_FALSE(warned(beam));
}

TEST(LinearStatics, RefusesWhatItCannotMean) {
  const std::string load = "p = { type = \"load\", a = \"tip\", force = [0, 0, 1] }";
  const std::vector<Mistake> mistakes = {
      {"gravity", "gravity = [0, 0, -9.81]\n" + linear_beam(load), {"bodies.rod", "density", "gravity"}},
      {"modes", linear_beam(load) + "[initial]\nmodes = 3\n", {"density", "natural frequencies"}},
      {"no density in a motion", linear_beam(load, 1, "[integrator]\nend = 1\n"), {"'density'", "only statics"}},
      {"a path", linear_beam(load, 1, kLinear + "first_step = 0.1\n"), {"first_step", "no meaning in linear statics"}},
      {"a start", linear_beam(load, 1, "[integrator]\nend = 1\n[initial]\nstatics = { linear = true }\n"), {"density"}},
      {"a number",
       replaced(linear_beam(load, 1, "[statics]\nlinear = 1\n"), "poisson = 0.3", "poisson = 0.3, density = 1"),
       {"linear", "true or false"}}};
  for (const Mistake& m : mistakes) {
    const std::string said = failure_of(m.text);
    for (const std::string& word : m.says) EXPECT_NE(said.find(word), std::string::npos) << m.name << ": " << said;
  }
  const std::string heavy =
      replaced(linear_beam(load, 1, "[integrator]\nend = 1\n[initial]\nstatics = { linear = true }\n"), "poisson = 0.3",
               "poisson = 0.3, density = 1");
  EXPECT_NE(failure_of(heavy).find("a run of its own"), std::string::npos);
}

// The path of a truss that snaps through ends at its limit point, and the error says what else there is.
TEST(LinearStatics, IsNamedWhereAPathEnds) {
  std::string truss =
      "[bodies.apex]\ntype = \"rigid\"\nmass = 1\nbox = [0.1, 0.1, 0.1]\nposition = [0, 0, 0.2]\n[joints.rail]\n"
      "type = \"prismatic\"\nbodies = [\"ground\", \"apex\"]\nat = [0, 0, 0.2]\naxis = [0, 0, 1]\n";
  for (const int side : {-1, 1})
    truss += fmt::format(
        "[forces.s{}]\ntype = \"spring\"\na = {{ body = \"ground\", point = [{}, 0, 0] }}\nb = {{ body = "
        "\"apex\" }}\nstiffness = 1000\n",
        side + 1, side);
  truss += "[forces.weight]\ntype = \"load\"\na = { body = \"apex\" }\nforce = [0, 0, -30]\n";
  const std::string said = failure_of(truss + "[statics]\npath = \"load-steps\"\n");
  EXPECT_NE(said.find("linear = true in [statics]"), std::string::npos) << said;
  const Simulation s = simulated(truss + kLinear);
  const double slope = 0.2 * 0.2 / (1 + 0.2 * 0.2);  // sin^2 of the springs
  EXPECT_NEAR(s.value("apex.position.z"), 0.2 - 30 / (2000 * slope), 1e-10);
}

}  // namespace linear_statics_test
}  // namespace espalier::dynamics
