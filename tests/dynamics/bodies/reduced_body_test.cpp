// Reduced flexible bodies: the nodal body's own equations on their motions, modes, derivatives, conserved quantities.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/integrators/bdf.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/integrators/vibrations.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"
#include "dynamics/reference/free_flight.hpp"

namespace espalier::dynamics {
namespace reduced_body_test {

// A soft block on a wall, a spring at its end, a rigid body beside it, pressure on its top.
std::string held(const std::string& reduce) {
  return R"(
gravity = [0, 0, -9.81]
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.4, lz = 0.3, divisions = [4, 2, 1] }
material = { young = 300, poisson = 0.3, density = 7 }
damping = { mass = 0.2, stiffness = 0.01 }
rotation = { axis = [1, 2, 3], angle = 0.7 }
position = [0.3, 0.2, 0.1]
)" + reduce +
         R"(
[bodies.weight]
type = "rigid"
mass = 2
box = [0.3, 0.2, 0.1]
position = [1.5, 0.2, 0.3]
[markers]
wall = { body = "block", face = "x0" }
tip = { body = "block", face = "x1", axis = [0, 0, 1] }
corner = { body = "block", near = [1, 0.2, 0.3] }
[joints]
clamp = { type = "fixed", attach = "mean", a = { body = "ground" }, b = "wall" }
pin = { type = "revolute", a = "tip", b = { body = "weight" } }
[forces]
spring = { type = "spring", a = "corner", b = { body = "ground", point = [1, 2, 1] }, stiffness = 3, damping = 0.5, rest = 1 }
bushing = { type = "bushing", a = "tip", b = { body = "weight" }, stiffness = [1, 2, 3], angular_stiffness = [2, 1, 3], angular_damping = [0.1, 0.2, 0.3] }
push = { type = "load", a = "tip", force = [1, 2, 3], moment = [0.3, 0.2, 0.1], follower = true }
top = { type = "pressure", body = "block", face = "z1", pressure = "0.5 + 0.5*t" }
[integrator]
end = 0.1
)";
}

const char* const kReduced = "reduce = { modes = 6, damping = 0.03 }\n";

// Truth: central differences, as for all other components (jacobian_test.cpp).
TEST(ReducedBody, DerivativesAgreeWithDifferences) {
  const auto mechanism = built(held(kReduced));
  ASSERT_NE(mechanism->bodies[0].reduced, nullptr);
  EXPECT_GT(mechanism->bodies[0].reduced->modes(), 12);
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const JacobianCheck found = check_jacobians(mechanism->system, anywhere(*mechanism, seed, 0.1));
    EXPECT_LT(found.largest(), 2e-7) << found.worst << ", seed " << seed;
  }
}

// Velocities and accelerations of all nodes by differences of their positions along a motion of the reduced body.
struct NodalPath {
  Eigen::VectorXd v, a;
  Eigen::MatrixXd jacobian;
};

NodalPath nodal_path(const ReducedBody& body, AssembledSystem& system, const State& s) {
  const auto positions = [&](ConstSpan q) {
    std::vector<double> x, none;
    body.nodal_motion(q, {}, x, none);
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size())));
  };
  const auto moved = [&](const std::vector<double>& step) {
    std::vector<double> q(s.q.size());
    system.retract(s.q, step, q);
    return positions(q);
  };
  constexpr double kStep = 1e-5, kTime = 1e-3;
  NodalPath path;
  path.jacobian.resize(static_cast<Eigen::Index>(body.nodal().reference().size()),
                       static_cast<Eigen::Index>(s.v.size()));
  for (std::size_t k = 0; k < s.v.size(); ++k) {
    std::vector<double> step(s.v.size(), 0.0);
    step[k] = kStep;
    const Eigen::VectorXd up = moved(step);
    step[k] = -kStep;
    path.jacobian.col(static_cast<Eigen::Index>(k)) = (up - moved(step)) / (2 * kStep);
  }
  // q (+) (t v + t^2 a / 2): its second derivative at 0 has the accelerations a (the terms of the chart are of t^3)
  const auto at_time = [&](double t) {
    std::vector<double> step(s.v.size());
    for (std::size_t k = 0; k < step.size(); ++k) step[k] = t * s.v[k] + 0.5 * t * t * s.a[k];
    return moved(step);
  };
  path.v = path.jacobian * Eigen::Map<const Eigen::VectorXd>(s.v.data(), static_cast<Eigen::Index>(s.v.size()));
  const Eigen::VectorXd middle = at_time(0);
  const auto second = [&](double t) { return Eigen::VectorXd((at_time(t) - 2 * middle + at_time(-t)) / (t * t)); };
  path.a = (4 * second(kTime) - second(2 * kTime)) / 3;  // error of t^4
  return path;
}

// Truth: the consistent mass of the mesh, F = J^T M (a + alpha v) with J by differences, and K on small strain. All of
// the inertia is there: centrifugal, Coriolis and Euler terms, for solids and for beams with their gradients.
TEST(ReducedBody, HasAllTheInertiaOfTheMesh) {
  const std::string beam = R"(
[bodies.block]
type = "beam"
start = [0.2, 0, 0]
end = [1.4, 0.3, 0]
elements = 4
radius = 0.05
material = { young = 1e4, poisson = 0.3, density = 50 }
damping = { mass = 0.3 }
reduce = { modes = 5 }
[markers]
[integrator]
end = 1
)";
  for (const std::string& text : {beam, std::string(R"(
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.4, lz = 0.3, divisions = [3, 2, 1] }
material = { young = 300, poisson = 0.3, density = 7 }
damping = { mass = 0.3 }
reduce = { modes = 8 }
[integrator]
end = 1
)")}) {
    const auto mechanism = built(text);
    const ReducedBody& body = *mechanism->bodies[0].reduced;
    const State s = anywhere(*mechanism, 3, 0.2);
    const NodalPath path = nodal_path(body, mechanism->system, s);
    std::vector<double> f(s.v.size(), 0.0);
    mechanism->system.residual(s.view(), f);
    const FlexibleBody& mesh = body.nodal();
    const VertexPattern& p = mesh.assembly().pattern();
    Eigen::VectorXd inertia = Eigen::VectorXd::Zero(path.a.size());
    for (Index b = 0; b < mesh.vertices(); ++b)
      for (Offset e = p.ptr[static_cast<std::size_t>(b)]; e < p.ptr[static_cast<std::size_t>(b) + 1]; ++e) {
        const Index a = p.ind[static_cast<std::size_t>(e)];
        inertia.segment<3>(3 * b) +=
            mesh.mass()[static_cast<std::size_t>(e)] * (path.a.segment<3>(3 * a) + 0.3 * path.v.segment<3>(3 * a));
      }
    Eigen::VectorXd expected = path.jacobian.transpose() * inertia;
    expected.tail(body.modes()) += body.shapes().stiffness.cwiseProduct(body.amplitudes(s.q));
    const double size = expected.cwiseAbs().maxCoeff();
    for (std::size_t k = 0; k < f.size(); ++k)
      EXPECT_NEAR(f[k], expected[static_cast<Eigen::Index>(k)], 2e-8 * size)
          << mechanism->system.coordinate_name(static_cast<Index>(k));
    // Momentum and energy, too, are those of the nodes.
    std::vector<double> x, rate;
    body.nodal_motion(s.q, s.v, x, rate);
    const MassProperties own = body.mass_properties(s.q, s.v), nodes = mesh.mass_properties(x, rate);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(own.centre[i], nodes.centre[i], 1e-12);
      EXPECT_NEAR(own.momentum[i], nodes.momentum[i], 1e-11 * own.mass);
      EXPECT_NEAR(own.angular_momentum[i], nodes.angular_momentum[i], 1e-11 * own.mass);
    }
  }
}

std::vector<double> frequencies(const std::string& text, Index count) {
  const auto mechanism = built(text);
  Equations equations(mechanism->system);
  State s(mechanism->system.sizes());
  mechanism->system.initial(s.q, s.v);
  Options solver;
  solver.threads = 1;
  std::vector<double> result;
  for (const Mode& mode : small_vibrations(equations, s, count, solver).modes) result.push_back(mode.frequency);
  return result;
}

std::string cantilever(const std::string& reduce) {
  return R"(
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.1, lz = 0.06, divisions = [8, 2, 2] }
material = { young = 2e11, poisson = 0.3, density = 7800 }
)" + reduce +
         R"(
[bodies.weight]
type = "rigid"
mass = 5
box = [0.1, 0.1, 0.1]
position = [1.05, 0, 0]
[markers]
wall = { body = "block", face = "x0" }
tip = { body = "block", face = "x1" }
[joints]
clamp = { type = "fixed", attach = "mean", a = { body = "ground" }, b = "wall" }
load = { type = "fixed", attach = "mean", a = "tip", b = { body = "weight" } }
[integrator]
end = 1
)";
}

// Truth: the nodal body. All shapes: the same pencil in another basis.
TEST(ReducedBody, WithAllModesIsTheNodalBody) {
  const std::vector<double> nodal = frequencies(cantilever(""), 20),
                            reduced = frequencies(cantilever("reduce = { modes = 100000 }\n"), 20);
  ASSERT_EQ(reduced.size(), 20U);
  for (std::size_t i = 0; i < 20; ++i) EXPECT_NEAR(reduced[i] / nodal[i], 1, 1e-8) << i;
}

// Frequencies come from above (Rayleigh) and closer with each mode.
TEST(ReducedBody, ConvergesWithTheNumberOfModes) {
  const std::vector<double> nodal = frequencies(cantilever(""), 6);
  double before = 1;
  for (const int modes : {0, 4, 8, 16, 32}) {
    const std::vector<double> own = frequencies(cantilever("reduce = { modes = " + std::to_string(modes) + " }\n"), 6);
    double error = 0;
    for (std::size_t i = 0; i < std::min(own.size(), nodal.size()); ++i) {
      EXPECT_GT(own[i] / nodal[i], 1 - 1e-9);
      error = std::max(error, own[i] / nodal[i] - 1);
    }
    std::printf("%3d modes: largest error of 6 frequencies %.2e\n", modes, error);
    EXPECT_LT(error, modes == 0 ? 2 : before);
    before = error;
  }
  EXPECT_LT(before, 1e-4);
}

// Modes by frequency are those that the number would give.
TEST(ReducedBody, KeepsModesBelowAFrequency) {
  const auto by_frequency = built(cantilever("reduce = { frequency = 2e3 }\n"));
  const Index kept =
      by_frequency->bodies[0].reduced->modes() - by_frequency->bodies[0].reduced->shapes().from_interfaces;
  ASSERT_GT(kept, 2);
  const auto by_number = built(cantilever("reduce = { modes = " + std::to_string(kept) + " }\n"));
  const Eigen::VectorXd a = by_frequency->bodies[0].reduced->shapes().stiffness,
                        b = by_number->bodies[0].reduced->shapes().stiffness;
  ASSERT_EQ(a.size(), b.size());
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-8 * a.maxCoeff());
}

// No joint, one that holds a point, two frames on one face, three on a line: rigid motion stays free, six zeros.
TEST(ReducedBody, KeepsSixRigidMotionsWhateverHoldsIt) {
  const std::string free = R"(
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.2, lz = 0.1, divisions = [5, 2, 1] }
material = { young = 2e11, poisson = 0.3, density = 7800 }
)";
  const std::string end = "[integrator]\nend = 1\n";
  const std::string weak = R"(
[forces]
one = { type = "spring", a = { body = "block", near = [0, 0, 0] }, b = { body = "ground", point = [5, 6, 7] }, stiffness = 0, rest = 0 }
)";
  const std::string more = R"(
[forces]
one = { type = "spring", a = { body = "block", face = "x0" }, b = { body = "ground", point = [5, 6, 7] }, stiffness = 0, rest = 0 }
two = { type = "spring", a = { body = "block", face = "x0" }, b = { body = "ground", point = [5, 6, 7] }, stiffness = 0, rest = 0 }
six = { type = "spring", a = { body = "block", face = "x1" }, b = { body = "ground", point = [5, 6, 7] }, stiffness = 0, rest = 0 }
)";
  const std::vector<double> nodal = frequencies(free + end, 10);
  for (const std::string& held_by : {std::string(), weak, more}) {
    const std::vector<double> own = frequencies(free + "reduce = { modes = 12 }\n" + held_by + end, 10);
    ASSERT_EQ(own.size(), 10U);
    for (std::size_t i = 0; i < 6; ++i) EXPECT_LT(own[i], 1e-3 * nodal[6]) << held_by;
    for (std::size_t i = 6; i < 10; ++i) EXPECT_NEAR(own[i] / nodal[i], 1, held_by.empty() ? 1e-7 : 2e-3) << held_by;
  }
}

Drift tumble(double tolerance) {
  const auto mechanism = built(R"(
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 3, ly = 2, lz = 1, divisions = [3, 2, 1] }
material = { young = 2e5, poisson = 0.3, density = 1000 }
velocity = [1, -2, 0.5]
angular_velocity = [1, 2, 3]
reduce = { modes = 20 }
[integrator]
end = 1
)");
  return free_flight(*mechanism, tolerance, 0.3);
}

TEST(ReducedBody, KeepsMomentaAndEnergyInFreeFlight) {
  const Drift coarse = tumble(1e-5), fine = tumble(1e-7);
  EXPECT_GT(fine.strain, 1e-3);  // it does deform
  EXPECT_LT(coarse.momentum, 1e-12);
  EXPECT_LT(fine.angular, 1e-6);
  EXPECT_LT(fine.energy, 1e-6);
  EXPECT_LT(fine.angular, 0.2 * coarse.angular);
  EXPECT_LT(fine.energy, 0.2 * coarse.energy);
}

// A bar that turns about its end: u(L) / L = tan(k) / k - 1, k = omega L sqrt(rho / E), without Poisson's ratio.
TEST(ReducedBody, TurningBarIsStretched) {
  const auto stretch = [](int modes) {
    const Simulation s = simulated(R"(
[bodies.bar]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.05, lz = 0.05, divisions = [20, 1, 1] }
material = { young = 1e9, poisson = 0, density = 1000 }
damping = { stiffness = 3e-3 }
reduce = { modes = )" + std::to_string(modes) +
                                   R"( }
[markers]
root = { body = "bar", face = "x0" }
tip = { body = "bar", face = "x1" }
[joints]
hinge = { type = "revolute", a = { body = "ground", point = [0, 0.025, 0.025], axis = [0, 0, 1] }, b = "root" }
motor = { type = "rotation-motor", a = { body = "ground", axis = [0, 0, 1] }, b = "root", motion = "30*ramp(t, 0, 1) " }
[output]
quantities = ["tip.position", "root.position"]
[integrator]
end = 2
relative = 1e-6
absolute = 1e-8
)");
    return std::hypot(s.value("tip.position.x") - s.value("root.position.x"),
                      s.value("tip.position.y") - s.value("root.position.y")) -
           1;
  };
  const double k = 30 * std::sqrt(1000 / 1e9), truth = std::tan(k) / k - 1;
  double before = 1;
  for (const int modes : {6, 24}) {
    const double error = std::abs(stretch(modes) / truth - 1);
    std::printf("%2d modes: stretch of a turning bar wrong by %.2e\n", modes, error);
    EXPECT_LT(error, before);
    before = error;
  }
  EXPECT_LT(before, 3e-3);  // the tolerance, 1e-6 of its length
}

// A flexible arm is swung up: the nodal body in the same mechanism is the truth, both beside each other in one model.
TEST(ReducedBody, SwingsLikeTheNodalBodyBesideIt) {
  const auto arm = [](const std::string& name, const std::string& reduce) {
    return "[bodies." + name + R"(]
type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 8
radius = 0.02
material = { young = 2e10, poisson = 0.3, density = 1000 }
damping = { stiffness = 5e-4 }
)" + reduce +
           "[joints." + name + R"(_hinge]
type = "revolute"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = ")" +
           name + R"(", node = 1 }
[joints.)" +
           name + R"(_motor]
type = "rotation-motor"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = ")" +
           name + R"(", node = 1 }
motion = "0.75*step(t, 0, 0, 0.5, 1) "
[markers.)" +
           name + R"(_tip]
body = ")" +
           name + R"("
node = -1
)";
  };
  const Simulation s =
      simulated("gravity = [0, -9.81, 0]\n" + arm("nodal", "") + arm("reduced", "reduce = { modes = 8 }\n") + R"(
[output]
quantities = ["nodal_tip.position", "reduced_tip.position", "nodal_motor.moment.z", "reduced_motor.moment.z", "reduced.position.x", "reduced.angular_momentum.z"]
[integrator]
end = 1
relative = 1e-6
absolute = 1e-7
)");
  const double angle = 0.75;
  const auto deflection = [&](const std::string& tip) {
    return std::cos(angle) * s.value(tip + ".position.y") - std::sin(angle) * s.value(tip + ".position.x");
  };
  EXPECT_LT(deflection("nodal_tip"), -4e-4);  // it bends
  EXPECT_NEAR(deflection("reduced_tip") / deflection("nodal_tip"), 1, 1e-3);
  EXPECT_NEAR(s.value("reduced_motor.moment.z") / s.value("nodal_motor.moment.z"), 1, 2e-4);
}

// Nothing that cannot be reduced is reduced silently.
TEST(ReducedBody, SaysWhatCannotBeReduced) {
  const auto message = [](const std::string& text) {
    Simulation simulation;
    const Status status = simulation.load_text(text, "model.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input) << status.message;
    return status.message;
  };
  const auto expect = [&](const std::string& reduce, const std::string& what) {
    const std::string said = message(cantilever(reduce));
    EXPECT_NE(said.find(what), std::string::npos) << said;
    EXPECT_NE(said.find("bodies.block"), std::string::npos) << said;
  };
  expect("reduce = {}\n", "needs 'modes'");
  expect("reduce = { modes = -1 }\n", "modes");
  expect("reduce = { modes = 2.5 }\n", "modes");
  expect("reduce = { frequency = 0 }\n", "frequency");
  expect("reduce = { frequency = nan }\n", "frequency");
  expect("reduce = { modes = 3, damping = -1 }\n", "negative");
  expect("reduce = { mode = 3 }\n", "modes");
  expect("reduce = 3\n", "reduce");
  const std::string cable = R"(
[bodies.block]
type = "cable"
start = [0, 0, 0]
end = [1, 0, 0]
radius = 0.01
material = { young = 2e11, poisson = 0.3, density = 7800 }
reduce = { modes = 3 }
[integrator]
end = 1
)";
  EXPECT_NE(message(cable).find("inertia about an axis"), std::string::npos);
  const std::string rigid = "[bodies.a]\ntype = \"rigid\"\nmass = 1\nbox = [1, 1, 1]\nreduce = { modes = 3 }\n";
  EXPECT_NE(message(rigid + "[integrator]\nend = 1\n").find("bodies.a.reduce"), std::string::npos);
}

}  // namespace reduced_body_test
}  // namespace espalier::dynamics
