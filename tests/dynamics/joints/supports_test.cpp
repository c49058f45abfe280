// Nodes of flexible bodies that are held and led one by one; shells, their edges and the pressure on them. Truths:
// closed forms of plates, beams and shells, wholes beside their quarters.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace supports_test {

const std::string kLinear = "[statics]\nlinear = true\n";

std::string refusal(const std::string& text) {
  Simulation s;
  Status status = s.load_text(text, "model.toml");
  if (status.ok()) status = s.run();
  EXPECT_FALSE(status.ok()) << text;
  return status.message;
}

std::vector<double> frequencies(const std::string& text, int count) {
  SimulationOptions options;
  options.set = {fmt::format("initial.modes={}", count)};
  Simulation s(options);
  const Status status = s.load_text(text + "[integrator]\nend = 1\n", "model.toml");
  EXPECT_TRUE(status.ok()) << status.message;
  std::vector<double> found;
  for (const SimulationMode& m : s.summary().modes) found.push_back(m.frequency);
  return found;
}

/// The plate of issue 42: 0.4 x 0.3 x 0.002 m, aluminium, clamped along one short edge: 10.76, 32.48, 67.09, 112.58 Hz
/// (thin plate).
TEST(Supports, ClampAPlate) {
  const double truth[] = {10.76, 32.48, 67.09, 112.58};
  const std::string material = "material = { young = 70e9, poisson = 0.33, density = 2700 }\n";
  const std::string solid =
      "[bodies.plate]\ntype = \"solid\"\nhex8 = \"shell\"\nmesh = { part = \"block\", lx = 0.4, ly = 0.3, lz "
      "= 0.002, divisions = [16, 12, 1] }\n" +
      material + "[supports]\nclamp = { body = \"plate\", face = \"x0\", hold = \"all\" }\n";
  const std::string shell =
      "[bodies.plate]\ntype = \"shell\"\nx = [0.4, 0, 0]\ny = [0, 0.3, 0]\nnx = 16\nny = 12\nthickness = "
      "0.002\n" +
      material + "[supports]\nclamp = { body = \"plate\", edge = \"x0\", hold = \"all\" }\n";
  for (const std::string& text : {solid, shell}) {
    const std::vector<double> found = frequencies(text, 4);
    ASSERT_EQ(found.size(), 4U);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(found[k], truth[k], 0.015 * truth[k]) << k;
  }
  // Held in place without its slope, the edge is a hinge: the first mode is none any more.
  EXPECT_LT(frequencies(replaced(shell, "hold = \"all\"", "hold = \"xyz\""), 1)[0], 0.01);
}

/// A strip of shells, nu = 0: E I = 1.
std::string strip(const std::string& more) {
  return "[bodies.strip]\ntype = \"shell\"\norigin = [0, -0.05, 0]\nx = [1, 0, 0]\ny = [0, 0.1, 0]\nnx = 20\nny = "
         "2\nthickness = "
         "0.01\nmaterial = { young = 1.2e8, poisson = 0 }\n[markers]\ntip = { body = \"strip\", edge = \"x1\" }\n" +
         more + kLinear;
}

// F L^3 / (3 E I) + F L / (5/6 G A), M L / (E I), and what the clamp bears: by a support, by a joint that holds the
// edge as one rigid piece, by one that holds its mean.
TEST(Supports, ClampAShellsEdge) {
  const double inertia = 0.1 * 1e-6 / 12, stiffness = 1.2e8 * inertia;
  const std::string loads = "[forces]\np = { type = \"load\", a = \"tip\", force = [0, 0, 2], moment = [0, 3, 0] }\n";
  const double deflection = 2 / (3 * stiffness) + 2 / (5.0 / 6 * 0.6e8 * 1e-3) - 3 / (2 * stiffness);
  const double turn = -2 / (2 * stiffness) + 3 / stiffness;
  for (const std::string& clamp :
       {std::string("[supports]\nwall = { body = \"strip\", edge = \"x0\", hold = \"all\" }\n"),
        std::string("[joints]\nwall = { type = \"fixed\", a = { body = \"ground\" }, b = { body = \"strip\", edge = "
                    "\"x0\" } }\n"),
        std::string("[joints]\nwall = { type = \"fixed\", a = { body = \"ground\" }, b = { body = \"strip\", edge = "
                    "\"x0\", attach = "
                    "\"mean\" } }\n")}) {
    const Simulation s = simulated(strip(clamp + loads));
    EXPECT_NEAR(s.value("tip.position.z"), deflection, 2e-3 * std::abs(deflection)) << clamp;
    EXPECT_NEAR(s.value("tip.rotation.y"), turn, 2e-3 * std::abs(turn)) << clamp;
    EXPECT_NEAR(s.value("wall.force.z"), -2, 1e-8);
    EXPECT_NEAR(s.value("wall.moment.y"), 2 - 3, 1e-8);
  }
}

// Truth: differences, which are exact but for rounding: reactions are linear in multipliers, their arms in coordinates.
TEST(Supports, DerivativesOfReactions) {
  const std::string held =
      "[supports]\nwall = { body = \"strip\", edge = \"x0\", hold = \"all\" }\npin = { body = \"strip\", node = 7, "
      "hold "
      "= \"z\" }\n";
  const auto mechanism = built(strip(held));
  ASSERT_EQ(mechanism->supports.size(), 2U);
  System& system = mechanism->system;
  for (const Support* support : mechanism->supports)
    for (const bool moment : {false, true}) {
      SCOPED_TRACE(fmt::format("{}, moment {}", support->name(), moment));
      const VectorFunctionPtr reaction = reaction_of(*support, moment);
      const State s = anywhere(*mechanism, 3, 0.1);
      VectorFunction::Derivatives d;
      EXPECT_EQ(reaction->derivatives(s.view(), d), reaction->value(s.view()));
      ASSERT_EQ(d.q.cols(), static_cast<Eigen::Index>(reaction->coordinates().size()));
      EXPECT_EQ(reaction->coordinates().empty(), !moment);
      const double h = 0.25;
      for (std::size_t k = 0; k < reaction->coordinates().size(); ++k) {
        Vec3 ends[2];
        for (const int side : {0, 1}) {
          State moved = s;
          std::vector<double> step(s.v.size(), 0.0);
          step[static_cast<std::size_t>(reaction->coordinates()[k])] = side == 0 ? -h : h;
          system.retract(s.q, step, moved.q);
          ends[side] = reaction->value(moved.view());
        }
        EXPECT_LE((d.q.col(static_cast<Eigen::Index>(k)) - (ends[1] - ends[0]) / (2 * h)).norm(), 1e-12) << k;
      }
      for (std::size_t k = 0; k < reaction->multipliers().size(); ++k) {
        State moved = s;
        moved.lambda[static_cast<std::size_t>(reaction->multipliers()[k])] += 1;
        const Vec3 slope = reaction->value(moved.view()) - reaction->value(s.view());
        EXPECT_LE((d.lambda.col(static_cast<Eigen::Index>(k)) - slope).norm(), 1e-12) << k;
      }
    }
}

// A rigid body on an edge, stiffly and in the mean: the same deflection of a strip with nu = 0, by the body's own
// marker.
TEST(Supports, CoupleAnEdgeToABody) {
  const double stiffness = 1.2e8 * 0.1 * 1e-6 / 12;
  for (const char* attach : {"rigid", "mean"}) {
    const Simulation s =
        simulated(strip(fmt::format("[bodies.hub]\ntype = \"rigid\"\nmass = 1\nbox = [0.1, 0.1, 0.1]\nposition = [1.2, "
                                    "0, 0]\n[supports]\nwall = {{ body = "
                                    "\"strip\", edge = \"x0\", hold = \"all\" }}\n[joints]\nweld = {{ type = "
                                    "\"fixed\", a = {{ body = \"hub\", point = [-0.2, 0, "
                                    "0] }}, b = {{ body = \"strip\", edge = \"x1\", attach = \"{}\" }} }}\n[forces]\np "
                                    "= {{ type = \"load\", a = {{ body = "
                                    "\"hub\" }}, force = [0, 0, 1] }}\n",
                                    attach)));
    const double tip = 1 / (3 * stiffness) + 0.2 / (2 * stiffness), turn = 1 / (2 * stiffness) + 0.2 / stiffness;
    EXPECT_NEAR(s.value("hub.position.z"), tip + 0.2 * turn, 2e-3 * (tip + 0.2 * turn)) << attach;
    EXPECT_NEAR(s.value("weld.force.z"), 1, 1e-9);  // on the strip
  }
}

/// A square plate of shells clamped all round, or a quarter of it; pressure 100 on top.
std::string clamped_square(bool whole) {
  const int n = whole ? 24 : 12;
  return fmt::format(
             "[bodies.plate]\ntype = \"shell\"\nx = [{0}, 0, 0]\ny = [0, {0}, 0]\nnx = {1}\nny = {1}\nthickness = "
             "0.01\nmaterial = {{ "
             "young = 2.1e11, poisson = 0.3 }}\n[markers]\nmiddle = {{ body = \"plate\", near = [0.5, 0.5, 0] "
             "}}\n[forces]\nwind = {{ type = "
             "\"pressure\", body = \"plate\", face = \"top\", pressure = 100 }}\n[supports]\nleft = {{ body = "
             "\"plate\", edge = \"x0\", hold = "
             "\"all\" }}\nlow = {{ body = \"plate\", edge = \"y0\", hold = \"all\" }}\n{2}",
             whole ? 1 : 0.5, n,
             whole ? "right = { body = \"plate\", edge = \"x1\", hold = \"all\" }\nhigh = { body = \"plate\", edge = "
                     "\"y1\", hold = \"all\" }\n"
                   : "right = { body = \"plate\", edge = \"x1\", symmetry = \"x\" }\nhigh = { body = \"plate\", edge = "
                     "\"y1\", symmetry = \"y\" "
                     "}\n") +
         kLinear;
}

// 0.001265 p a^4 / D (Timoshenko and Woinowsky-Krieger 1959, table 35); a quarter is the whole.
TEST(Supports, PressureOnAClampedPlate) {
  const Simulation whole = simulated(clamped_square(true)), quarter = simulated(clamped_square(false));
  const double d = 2.1e11 * 1e-6 / (12 * (1 - 0.09)), truth = -0.001265 * 100 / d;
  EXPECT_NEAR(whole.value("middle.position.z"), truth, 0.01 * std::abs(truth));
  EXPECT_NEAR(quarter.value("middle.position.z"), whole.value("middle.position.z"), 1e-8 * std::abs(truth));
  double sum = 0, part = 0;
  for (const char* edge : {"left.force.z", "low.force.z", "right.force.z", "high.force.z"}) sum += whole.value(edge);
  for (const char* edge : {"left.force.z", "low.force.z"}) part += quarter.value(edge);
  // Rounding of the stiffnesses through the thickness, 2e9, times positions: some 1e-7.
  EXPECT_NEAR(sum, 100, 1e-6);
  EXPECT_NEAR(part, 25, 1e-6);
  EXPECT_TRUE(whole.summary().redundant.empty());  // corners are held once
}

// A solid cube squeezed between planes: an eighth of it, by symmetry in a direction across, is all of it.
TEST(Supports, ASolidsSymmetry) {
  const auto block = [](double size, int n, const std::string& supports) {
    return fmt::format(
               "[bodies.cube]\ntype = \"solid\"\nmesh = {{ part = \"block\", lx = 1, ly = {0}, lz = {0}, divisions = "
               "[2, {1}, "
               "{1}] }}\nmaterial = {{ young = 1e7, poisson = 0.3 }}\n[markers]\ncorner = {{ body = \"cube\", near = "
               "[1, {0}, "
               "{0}] }}\n[supports]\nbottom = {{ body = \"cube\", face = \"x0\", hold = \"all\" }}\ntop = {{ body = "
               "\"cube\", "
               "face = \"x1\", hold = \"yz\", motion = {{ x = -0.01 }} }}\n{2}[forces]\np = {{ type = \"pressure\", "
               "body = "
               "\"cube\", face = \"y1\", pressure = 1e4 }}\nq = {{ type = \"pressure\", body = \"cube\", face = "
               "\"z1\", pressure "
               "= 1e4 }}\n{3}",
               size, n, supports,
               supports.empty()
                   ? "r = { type = \"pressure\", body = \"cube\", face = \"y0\", pressure = 1e4 }\ns = { type = "
                     "\"pressure\", body = \"cube\", face = \"z0\", pressure = 1e4 }\n"
                   : "") +
           kLinear;
  };
  const Simulation whole = simulated(block(1, 4, "")),
                   quarter =
                       simulated(block(0.5, 2,
                                       "s = { body = \"cube\", face = \"y0\", symmetry = [0, 2, 0] }\nt = { body = "
                                       "\"cube\", face = \"z0\", symmetry = \"z\" }\n"));
  EXPECT_NEAR(4 * quarter.value("top.force.x"), whole.value("top.force.x"),
              1e-8 * std::abs(whole.value("top.force.x")));
  EXPECT_LT(whole.value("top.force.x"), -1e5);
  EXPECT_NEAR(whole.value("corner.position.x"), 0.99, 1e-12);
}

/// A bar with rollers, E A / L = 2e9 * 0.01 / 1.
std::string bar(const std::string& right, const std::string& run) {
  return "[bodies.bar]\ntype = \"solid\"\nmesh = { part = \"block\", lx = 1, ly = 0.1, lz = 0.1, divisions = [4, 1, 1] "
         "}\nmaterial = { "
         "young = 2e9, poisson = 0.3, density = 1000 }\n[markers]\nend = { body = \"bar\", face = \"x1\" "
         "}\n[supports]\nleft = { body = "
         "\"bar\", face = \"x0\", hold = \"x\" }\nlow = { body = \"bar\", face = \"z0\", hold = \"z\" }\nback = { body "
         "= \"bar\", face = "
         "\"y0\", hold = \"y\" }\nright = " +
         right + "\n" + run;
}

// A displacement's reaction is stiffness times displacement: constants, expressions, tables; statics and motion.
TEST(Supports, LeadNodes) {
  const double k = 2e9 * 0.01;
  const Simulation constant = simulated(bar("{ body = \"bar\", face = \"x1\", motion = { x = 1e-4 } }", kLinear));
  EXPECT_NEAR(constant.value("right.force.x"), k * 1e-4, 1e-8 * k * 1e-4);
  EXPECT_NEAR(constant.value("left.force.x"), -k * 1e-4, 1e-8 * k * 1e-4);
  EXPECT_NEAR(constant.value("low.force.z"), 0, 1e-6);
  const Simulation at_time = simulated(
      bar("{ body = \"bar\", face = \"x1\", motion = { x = \"1e-4*t^2\" } }", "[statics]\nlinear = true\ntime = 3\n"));
  EXPECT_NEAR(at_time.value("right.force.x"), k * 9e-4, 1e-7 * k * 9e-4);
  const Simulation path = simulated(
      bar("{ body = \"bar\", face = \"x1\", motion = { x = \"table(t)\" } }",
          "[splines.table]\nkind = \"linear\"\npoints = [[0, 0], [1, 1e-6], [2, 3e-6]]\n[statics]\ntime = 1.5\n"));
  EXPECT_NEAR(path.value("end.position.x") - 1, 2e-6, 1e-12);
  EXPECT_NEAR(path.value("right.force.x"), k * 2e-6, 1e-4 * k * 2e-6);
  const Simulation motion =
      simulated(bar("{ body = \"bar\", face = \"x1\", motion = { x = \"step(t, 0, 0, 1, 1e-4)\" } }",
                    "[integrator]\nend = 1.2\nmethod = \"generalized-alpha\"\nstep = 0.02\n"));
  EXPECT_NEAR(motion.value("end.position.x"), 1 + 1e-4, 1e-9);
  EXPECT_NEAR(motion.value("right.force.x"), k * 1e-4, 1e-3 * k * 1e-4);
}

// Along turned directions: a bar on an inclined roller, pushed along x, leaves along the incline.
TEST(Supports, AlongTurnedDirections) {
  const double angle = 0.3;
  const Simulation s = simulated(
      fmt::format("[bodies.beam]\ntype = \"beam\"\nstart = [0, 0, 0]\nend = [1, 0, 0]\nelements = 4\nradius = "
                  "0.05\nmaterial = {{ young = 2e11 "
                  "}}\n[markers]\ntip = {{ body = \"beam\", node = -1 }}\n[joints]\nhinge = {{ type = \"revolute\", a "
                  "= {{ body = \"ground\" }}, b = "
                  "{{ body = \"beam\", node = 1, axis = [0, 1, 0] }} }}\n[supports]\nroller = {{ body = \"beam\", node "
                  "= -1, hold = \"z\", rotation "
                  "= [0, {}, 0] }}\n[forces]\npush = {{ type = \"load\", a = \"tip\", force = [1000, 0, 0] }}\n",
                  -angle) +
      kLinear);
  const double dx = s.value("tip.position.x") - 1, dz = s.value("tip.position.z");
  EXPECT_NEAR(dz, std::tan(angle) * dx, 1e-9 * std::abs(dx));
  // The reaction is normal to the incline; the hinge bears no moment, so that the roller bears no force across.
  EXPECT_NEAR(s.value("roller.force.x"), -std::tan(angle) * s.value("roller.force.z"), 1e-6);
  EXPECT_NEAR(s.value("roller.force.z"), 0, 1e-6);
  EXPECT_NEAR(dx, 1000 / (2e11 * std::numbers::pi * 0.0025), 1e-6 * dx);
}

// A barrel vault under its weight on rigid diaphragms (Scordelis and Lo 1964): 0.3024 down at the middle of its free
// edge.
TEST(Supports, HoldCurvedShells) {
  const double arc = 25 * 40 * std::numbers::pi / 180;
  const Simulation s = simulated(
      fmt::format(
          "gravity = [0, 0, -10]\n[bodies.roof]\ntype = \"shell\"\norigin = [0, 0, 25]\nx = [{}, 0, 0]\ny = [0, 25, "
          "0]\ncurvature = "
          "-0.04\nnx = 16\nny = 16\nthickness = 0.25\nmaterial = {{ young = 4.32e8, poisson = 0, density = 36 "
          "}}\n[markers]\nfree = {{ body "
          "= \"roof\", edge = [\"x1\", \"y0\"] }}\n[supports]\ncrown = {{ body = \"roof\", edge = \"x0\", symmetry = "
          "\"x\" }}\nhalf = {{ body = "
          "\"roof\", edge = \"y0\", symmetry = \"y\" }}\nwall = {{ body = \"roof\", edge = \"y1\", hold = \"xz\" }}\n",
          arc) +
      kLinear);
  const double start = 25 * std::cos(40 * std::numbers::pi / 180);
  EXPECT_NEAR(s.value("free.position.z") - start, -0.3024, 0.02 * 0.3024);
  EXPECT_NEAR(s.value("wall.force.z"), 90 * arc * 25, 1e-3 * 90 * arc * 25);
}

// A quarter of a ring under pressure from inside: its radius grows by p (R - t/2) R / (E t).
TEST(Supports, PressureInARing) {
  const double radius = 1, thickness = 0.01, p = 1e5;
  const Simulation s = simulated(fmt::format("[bodies.ring]\ntype = \"shell\"\norigin = [0, 0, 1]\nx = [{}, 0, 0]\ny = "
                                             "[0, 0.1, 0]\ncurvature = -1\nnx = 40\nny = 1\nthickness "
                                             "= {}\nmaterial = {{ young = 2e11, poisson = 0 }}\n[markers]\nlow = {{ "
                                             "body = \"ring\", node = 41 }}\n[supports]\na = {{ body = "
                                             "\"ring\", edge = \"x0\", symmetry = \"x\" }}\nb = {{ body = \"ring\", "
                                             "edge = \"x1\", symmetry = \"z\" }}\nc = {{ body = \"ring\", "
                                             "nodes = \"all\", hold = \"y\" }}\n[forces]\ngas = {{ type = "
                                             "\"pressure\", body = \"ring\", face = \"bottom\", pressure = {} }}\n",
                                             std::numbers::pi / 2, thickness, p) +
                                 kLinear);
  const double growth = p * (radius - thickness / 2) * radius / (2e11 * thickness);
  EXPECT_NEAR(s.value("low.position.x") - 1, growth, 5e-3 * growth);
  EXPECT_NEAR(s.value("b.force.z"), -p * (radius - thickness / 2) * 0.1, 2e-3 * p * 0.1);
}

// Pressure on a shell has the tangent that its forces have: K - K_differences.
TEST(Supports, PressureOnShellsHasAnExactTangent) {
  const auto mechanism = built(
      "[bodies.s]\ntype = \"shell\"\nx = [1, 0, 0]\ny = [0, 1, 0.2]\ncurvature = 0.7\nnx = 2\nny = 2\nthickness = "
      "0.2\nmaterial = { young "
      "= 1, poisson = 0.3, density = 1 }\n[forces]\np = { type = \"pressure\", body = \"s\", face = \"bottom\", "
      "pressure = 0.3 }\nq = { "
      "type = \"pressure\", body = \"s\", face = \"top\", pressure = 0.7 }\n[supports]\nedge = { body = \"s\", edge = "
      "\"x0\", symmetry = "
      "[1, 1, 0] }\n[integrator]\nend = 1\n");
  const State s = anywhere(*mechanism, 5, 0.02);
  const JacobianCheck check = check_jacobians(mechanism->system, s);
  EXPECT_LT(check.largest(), 1e-7) << check.worst;
}

TEST(Supports, RefuseWhatTheyCannotHold) {
  const std::string shell =
      "[bodies.s]\ntype = \"shell\"\nx = [1, 0, 0]\ny = [0, 1, 0]\nthickness = 0.01\nmaterial = { young = 1e9 }\n"
      "[bodies.hub]\ntype = \"rigid\"\nmass = 1\nbox = [1, 1, 1]\n[bodies.beam]\ntype = \"beam\"\nstart = [0, 0, "
      "0]\nend = [1, 0, 0]\nradius = 0.1\nmaterial = { young = 1e9 }\n[bodies.block]\ntype = \"solid\"\nmesh = { part "
      "= \"block\", unknowns = 100 }\nmaterial = { young = 1e9 }\n[supports]\n";
  const std::vector<Mistake> mistakes = {
      {"nothing", "a = { body = \"s\", edge = \"x0\" }", {"hold = \"all\"", "symmetry", "motion"}},
      {"no place", "a = { body = \"s\", hold = \"all\" }", {"say where with one of"}},
      {"direction", "a = { body = \"s\", edge = \"x0\", hold = \"r\" }", {"\"all\", a clamp"}},
      {"edge", "a = { body = \"s\", edge = \"x2\", hold = \"all\" }", {"a shell has no 'x2'", "x0"}},
      {"face", "a = { body = \"s\", face = \"x0\", hold = \"all\" }", {"edge of a shell"}},
      {"body", "a = { body = \"t\", edge = \"x0\", hold = \"all\" }", {"unknown body 't'"}},
      {"rigid", "a = { body = \"hub\", node = 1, hold = \"all\" }", {"no nodes", "joint"}},
      {"beam", "a = { body = \"beam\", node = 1, symmetry = \"x\" }", {"planar joint", "hold = \"all\""}},
      {"edge of a solid", "a = { body = \"block\", edge = \"x0\", hold = \"all\" }", {"edge = [\"x0\", \"z1\"]"}},
      {"no such edge", "a = { body = \"block\", edge = [\"x0\", \"x1\"], hold = \"all\" }", {"no node in common"}},
      {"symmetry",
       "a = { body = \"s\", edge = \"x0\", symmetry = \"x\", hold = \"y\" }",
       {"does not go with 'symmetry'"}},
      {"zero", "a = { body = \"s\", edge = \"x0\", symmetry = [0, 0, 0] }", {"normal of the plane"}},
      {"unknown", "a = { body = \"s\", edge = \"x0\", hold = \"all\", motoin = 1 }", {"motoin"}},
      {"key", "a = { body = \"s\", edge = \"x0\", motion = { w = 1 } }", {"w"}},
      {"twice",
       "a = { body = \"s\", edge = \"x0\", hold = \"x\" }\nb = { body = \"s\", edge = \"x0\", motion = { x = 1 } }",
       {"held along x by 'a' already", "moves"}},
      {"all of it twice",
       "a = { body = \"s\", edge = \"x0\", hold = \"x\" }\nb = { body = \"s\", edge = \"x0\", hold = \"x\" }",
       {"holds nothing that 'a' does not"}}};
  for (const Mistake& m : mistakes) {
    const std::string said = refusal(shell + m.text + "\n" + kLinear);
    for (const std::string& word : m.says) EXPECT_NE(said.find(word), std::string::npos) << m.name << ": " << said;
  }
}

}  // namespace supports_test
}  // namespace espalier::dynamics
