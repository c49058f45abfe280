// Derivatives of simulations by parameters of their models: closed forms, differences of whole runs, repeated modes.
#include "espalier/sensitivities.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"

namespace espalier {
namespace sensitivities_test {

using dynamics::simulated;

SensitivityResult differentiated(const std::string& text, const std::vector<SensitivityParameter>& parameters,
                                 const SimulationOptions& options = {}) {
  SensitivityResult result = sensitivities_of_text(text, "model.toml", parameters, options);
  EXPECT_TRUE(result.status.ok()) << result.status.message;
  return result;
}

// Truth: x = x0 cos(w t), w = sqrt(k / m).
TEST(Sensitivities, OfAnOscillatorAreClosedForms) {
  const std::string text = R"(
[parameters]
k = 4
m = 2
x0 = 0.5
[bodies.mass]
type = "point"
mass = "m"
position = ["1 + x0", 0, 0]
[forces.spring]
type = "spring"
a = { body = "ground" }
b = { body = "mass" }
stiffness = "k"
rest = 1
[output]
quantities = ["mass.position.x", "mass.velocity.x", "energy.potential"]
[integrator]
end = 3
relative = 1e-9
absolute = 1e-10
)";
  const SensitivityResult r = differentiated(text, {{"parameters.k"}, {"parameters.m"}, {"parameters.x0"}});
  const double w = std::sqrt(2.0), x0 = 0.5;
  ASSERT_EQ(r.derivatives.size(), r.t.size() * 9);
  for (std::size_t i = 0; i < r.t.size(); ++i) {
    const double t = r.t[i], by_w = -x0 * t * std::sin(w * t);
    const double* d = &r.derivatives[9 * i];
    EXPECT_NEAR(d[0], by_w * w / 8, 2e-6) << t;
    EXPECT_NEAR(d[1], -by_w * w / 4, 2e-6) << t;
    EXPECT_NEAR(d[2], std::cos(w * t), 2e-6) << t;
    EXPECT_NEAR(d[5], -w * std::sin(w * t), 4e-6) << t;
  }
  EXPECT_LT(r.defect, 1e-8);
}

// Two pendulums in space, a motor force, friction of a damper; with a reduced flexible arm between them.
std::string linkage(bool flexible) {
  return R"(
gravity = [0, 0, -9.81]
[parameters]
length = 0.8
damping = 0.3
density = 500
[bodies.upper]
type = "rigid"
mass = 1.2
box = ["length", 0.1, 0.1]
position = ["length/2", 0, 0]
[bodies.lower]
)" +
         std::string(flexible ? R"(
type = "solid"
mesh = { part = "block", lx = 0.7, ly = 0.05, lz = 0.05, divisions = [6, 1, 1] }
material = { young = 2e8, poisson = 0.3, density = "density" }
damping = { stiffness = 2e-3 }
reduce = { modes = 4 }
position = ["length", -0.025, -0.025]
)"
                              : R"(
type = "rigid"
mass = "0.0018*density"
box = [0.7, 0.05, 0.05]
position = ["length + 0.35", 0, 0]
)") + R"(
[joints]
top = { type = "universal", a = { body = "ground", axis = [0, 0, 1] }, b = { body = "upper", point = ["-length/2", 0, 0] } }
elbow = { type = "revolute", a = { body = "upper", point = ["length/2", 0, 0], axis = [0, 1, 0] }, b = )" +
         (flexible ? R"({ body = "lower", face = "x0", axis = [0, 1, 0] })"
                   : R"({ body = "lower", point = [-0.35, 0, 0], axis = [0, 1, 0] })") +
         R"( }
[forces]
damper = { type = "rotational-spring", a = { body = "upper", point = ["length/2", 0, 0], axis = [0, 1, 0] }, b = )" +
         (flexible ? R"({ body = "lower", face = "x0", axis = [0, 1, 0] })"
                   : R"({ body = "lower", point = [-0.35, 0, 0], axis = [0, 1, 0] })") +
         R"(, stiffness = 0.5, damping = "damping" }
push = { type = "load", a = { body = "upper" }, force = [0, 2, 0] }
[output]
quantities = ["upper.position.z", "lower.position.y", "top.force.z", "elbow.angle"]
[integrator]
end = 0.5
relative = 1e-8
absolute = 1e-9
)";
}

// Truth: central differences of whole runs. Their error is that of the formula for large steps, and for small ones that
// of the runs, which take steps of their own: it must fall and rise again.
void expect_valley(const std::string& text, const std::string& parameter, double value, double floor) {
  const SensitivityResult r = differentiated(text, {{parameter}});
  const auto value_at = [&](double p) {
    SimulationOptions options;
    options.set = {parameter + "=" + std::to_string(p)};
    char exact[64];
    std::snprintf(exact, sizeof exact, "%s=%.17g", parameter.c_str(), p);
    options.set = {exact};
    const Simulation s = simulated(text, options);
    std::vector<double> x;
    for (const auto& [name, v] : s.summary().values) x.push_back(v);
    return x;
  };
  std::vector<double> errors;
  std::printf("%s:", parameter.c_str());
  for (const double relative : {3e-1, 3e-2, 3e-3, 3e-4, 1e-6, 1e-8, 1e-10}) {
    const double h = relative * value;
    const std::vector<double> above = value_at(value + h), below = value_at(value - h);
    double error = 0;
    for (std::size_t q = 0; q < r.quantities.size(); ++q) {
      const double own = r.derivative(r.quantities[q], parameter);
      error = std::max(error, std::abs((above[q] - below[q]) / (2 * h) - own) / std::max(std::abs(own), 1e-3));
    }
    std::printf(" %.0e: %.1e ", relative, error);
    errors.push_back(error);
  }
  std::printf("\n");
  const double least = *std::min_element(errors.begin(), errors.end());
  EXPECT_LT(least, floor) << parameter;
  EXPECT_GT(errors.front(), 30 * least) << parameter;
  EXPECT_GT(errors.back(), 30 * least) << parameter;
}

TEST(Sensitivities, OfMechanismsLieInTheValleyOfDifferences) {
  expect_valley(linkage(false), "parameters.length", 0.8, 1e-5);
  expect_valley(linkage(false), "parameters.damping", 0.3, 1e-5);
  expect_valley(linkage(false), "bodies.upper.mass", 1.2, 1e-5);
}

TEST(Sensitivities, OfReducedBodiesLieInTheValleyOfDifferences) {
  expect_valley(linkage(true), "parameters.density", 500, 2e-4);
}

std::string cantilever(double load) {
  return R"(
[bodies.beam]
type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 10
height = 0.02
width = 0.02
material = { young = 2e9, poisson = 0, density = 1000 }
[markers]
tip = { body = "beam", node = -1 }
[joints]
clamp = { type = "fixed", a = { body = "ground" }, b = { body = "beam", node = 1 } }
[forces]
load = { type = "load", a = "tip", force = [0, )" +
         std::to_string(load) + R"(, 0] }
[output]
quantities = ["tip.position.y", "clamp.moment.z"]
)";
}

// Truth: w = F L^3 / (3 E I) for a small load; differences where it is large.
TEST(Sensitivities, OfEquilibria) {
  const SensitivityResult small =
      differentiated(cantilever(1e-4) + "[statics]\n", {{"bodies.beam.material.young"}, {"forces.load.force.1"}});
  const double w = small.value("tip.position.y");
  EXPECT_NEAR(small.derivative("tip.position.y", "bodies.beam.material.young") * 2e9 / w, -1, 1e-5);
  EXPECT_NEAR(small.derivative("tip.position.y", "forces.load.force.1") * 1e-4 / w, 1, 1e-5);
  const std::string large = cantilever(20) + "[statics]\ntolerance = 1e-11\n";
  const SensitivityResult r = differentiated(large, {{"bodies.beam.material.young"}, {"bodies.beam.height"}});
  EXPECT_GT(r.value("tip.position.y"), 0.2);
  for (const auto& [path, value] :
       {std::pair{"bodies.beam.material.young", 2e9}, std::pair{"bodies.beam.height", 0.02}}) {
    const auto tip = [&, path = path](double p) {
      SimulationOptions options;
      char text[100];
      std::snprintf(text, sizeof text, "%s=%.17g", path, p);
      options.set = {text};
      return simulated(large, options).value("tip.position.y");
    };
    const double h = 1e-3 * value;
    const double truth = (8 * (tip(value + h) - tip(value - h)) - (tip(value + 2 * h) - tip(value - 2 * h))) / (12 * h);
    EXPECT_NEAR(r.derivative("tip.position.y", path) / truth, 1, 1e-5) << path;
  }
}

// Truths: the forward method; a closed form. The load follows the tip, so the stiffness is
// not symmetric and its transpose is another matrix.
TEST(Sensitivities, AdjointOfEquilibriaIsForward) {
  std::string text = cantilever(20) + "[statics]\ntolerance = 1e-11\n";
  text.replace(text.find("quantities = ["), 14, "quantities = [\"energy.potential\", \"tip.rotation.z\", ");
  text.replace(text.find("type = \"load\","), 14, "type = \"load\", follower = true,");
  const std::vector<SensitivityParameter> five = {{"bodies.beam.material.young"},
                                                  {"bodies.beam.height"},
                                                  {"bodies.beam.width"},
                                                  {"forces.load.force.1"},
                                                  {"bodies.beam.end.0"}};
  const auto by = [&](SensitivityMethod method) {
    SensitivityResult r = sensitivities_of_text(text, "model.toml", five, {}, method);
    EXPECT_TRUE(r.status.ok()) << r.status.message;
    return r;
  };
  const SensitivityResult forward = by(SensitivityMethod::forward), adjoint = by(SensitivityMethod::adjoint);
  EXPECT_FALSE(forward.adjoint);
  EXPECT_TRUE(adjoint.adjoint);
  EXPECT_LT(adjoint.defect, 1e-5);
  ASSERT_EQ(adjoint.derivatives.size(), forward.derivatives.size());
  EXPECT_EQ(adjoint.values, forward.values);
  ASSERT_EQ(adjoint.quantities.size(), 4U);
  for (std::size_t q = 0; q < 4; ++q)
    for (std::size_t p = 0; p < 5; ++p) {
      const double a = adjoint.derivatives[5 * q + p], f = forward.derivatives[5 * q + p];
      EXPECT_NEAR(a / f, 1, 2e-5) << adjoint.quantities[q] << " by " << five[p].path;
    }
  // More parameters than quantities: it is chosen; fewer: it is not.
  EXPECT_TRUE(by(SensitivityMethod::automatic).adjoint);
  EXPECT_FALSE(differentiated(text, {{"bodies.beam.height"}}).adjoint);
  const SensitivityResult small = sensitivities_of_text(
      cantilever(1e-4) + "[statics]\n", "model.toml", {{"bodies.beam.material.young"}}, {}, SensitivityMethod::adjoint);
  ASSERT_TRUE(small.status.ok()) << small.status.message;
  EXPECT_NEAR(small.derivative("tip.position.y", "bodies.beam.material.young") * 2e9 / small.value("tip.position.y"),
              -1, 1e-5);
}

// Truth: the forward method. Rigid bodies, springs and a joint: rotations, reactions, a quantity of several bodies.
TEST(Sensitivities, AdjointOfARigidFrameIsForward) {
  const std::string text = R"(
gravity = [0, -9.81, 0]
[parameters]
c = 300
length = 1
[bodies.arm]
type = "rigid"
mass = 2
box = ["length", 0.1, 0.1]
position = ["length/2", 0, 0]
[bodies.weight]
type = "rigid"
mass = 1
box = [0.2, 0.2, 0.2]
position = ["length", -0.5, 0.1]
[markers]
end = { body = "arm", point = ["length/2", 0, 0] }
[joints]
hinge = { type = "spherical", a = { body = "ground" }, b = { body = "arm", point = ["-length/2", 0, 0] } }
[forces]
hold = { type = "bushing", a = { body = "ground", point = ["length/2", 0, 0] }, b = { body = "arm" }, stiffness = [0, "c", "2*c"], angular_stiffness = [20, 0, 0] }
hang = { type = "bushing", a = "end", b = { body = "weight", point = [0, 0.5, 0] }, stiffness = ["c", "c", "c"], angular_stiffness = [5, 5, 5] }
push = { type = "load", a = { body = "weight" }, force = [0, 0, 3] }
[output]
quantities = ["hinge.force.y", "weight.position", "weight.rotation.x", "energy.potential"]
[statics]
tolerance = 1e-11
)";
  const std::vector<SensitivityParameter> parameters = {
      {"parameters.c"}, {"parameters.length"}, {"bodies.arm.mass"}, {"bodies.weight.mass"}, {"forces.push.force.2"}};
  const SensitivityResult forward =
      sensitivities_of_text(text, "model.toml", parameters, {}, SensitivityMethod::forward);
  const SensitivityResult adjoint =
      sensitivities_of_text(text, "model.toml", parameters, {}, SensitivityMethod::adjoint);
  ASSERT_TRUE(forward.status.ok()) << forward.status.message;
  ASSERT_TRUE(adjoint.status.ok()) << adjoint.status.message;
  EXPECT_LT(adjoint.defect, 1e-6);
  ASSERT_EQ(adjoint.derivatives.size(), 30U);
  for (std::size_t i = 0; i < 30; ++i) {
    const double scale = std::max(std::abs(forward.derivatives[i]), 1e-3 * std::abs(forward.values[i / 5]));
    EXPECT_NEAR(adjoint.derivatives[i], forward.derivatives[i], 1e-6 * scale)
        << adjoint.quantities[i / 5] << " by " << parameters[i % 5].path;
  }
}

TEST(Sensitivities, AdjointSaysWhatItCannot) {
  const auto message = [](const std::string& text, const std::vector<SensitivityParameter>& parameters) {
    const SensitivityResult r = sensitivities_of_text(text, "model.toml", parameters, {}, SensitivityMethod::adjoint);
    EXPECT_EQ(r.status.code, StatusCode::invalid_input) << r.status.message;
    return r.status.message;
  };
  const std::vector<SensitivityParameter> young = {{"bodies.beam.material.young"}};
  EXPECT_NE(message(cantilever(1) + "[statics]\n[initial]\nmodes = 2\n", young).find("modes"), std::string::npos);
  const std::string text = cantilever(1) + "[statics]\n";
  EXPECT_NE(message(text, {{"bodies.beam.elements", 1}}).find("jumps"), std::string::npos);
  EXPECT_NE(message(text, {{"bodies.beam.height", 1}}).find("beside its value"), std::string::npos);
}

// Truth: f ~ sqrt(E), f ~ 1 / sqrt(rho). The square section has each bending mode twice: the height stiffens one.
TEST(Sensitivities, OfFrequenciesThatComeTwice) {
  const std::string text = cantilever(0) + "[initial]\nmodes = 4\n[integrator]\nend = 1e-6\n";
  const SensitivityResult r =
      differentiated(text, {{"bodies.beam.material.young"}, {"bodies.beam.material.density"}, {"bodies.beam.height"}});
  ASSERT_EQ(r.modes.frequencies.size(), 4U);
  const std::vector<double>& f = r.modes.frequencies;
  EXPECT_NEAR(f[0] / f[1], 1, 1e-7);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(r.modes.derivatives[3 * i] * 2e9 / f[i], 0.5, 1e-6) << i;
    EXPECT_NEAR(r.modes.derivatives[3 * i + 1] * 1000 / f[i], -0.5, 1e-6) << i;
  }
  for (const std::size_t i : {0U, 2U}) {  // slender: 0 and f / h, but for shear
    EXPECT_NEAR(r.modes.derivatives[3 * i + 2] * 0.02 / f[i], 0, 5e-3) << i;
    EXPECT_NEAR(r.modes.derivatives[3 * (i + 1) + 2] * 0.02 / f[i], 1, 5e-3) << i;
  }
}

TEST(Sensitivities, SayWhatHasNoDerivative) {
  const auto message = [](const std::string& text, const std::vector<SensitivityParameter>& parameters,
                          const SimulationOptions& options = {}) {
    const SensitivityResult r = sensitivities_of_text(text, "model.toml", parameters, options);
    EXPECT_EQ(r.status.code, StatusCode::invalid_input) << r.status.message;
    return r.status.message;
  };
  const auto expect = [&](const std::string& said, const std::string& what) {
    EXPECT_NE(said.find(what), std::string::npos) << said;
  };
  const std::string text = linkage(false);
  expect(message(text, {}), "no parameter");
  expect(message(text, {{"parameters.lengt"}}), "parameters.lengt");
  expect(message(text, {{"bodies.upper.type"}}), "bodies.upper.type");
  expect(message(text, {{"bodies.upper"}}), "no number");
  expect(message(text, {{"bodies.upper.position.3"}}), "bodies.upper.position.3");
  expect(message(text, {{"forces.push.force.0"}}), "give a step");
  expect(message(text, {{"parameters.length", -1}}), "greater than 0");
  expect(message(text, {{"parameters.length", NAN}}), "greater than 0");
  expect(message(text, {{"bodies.upper.mass", 2}}), "beside its value");
  expect(message(text + "[events.e]\nwhen = \"elbow.angle\"\nstop = true\n", {{"parameters.length"}}), "events");
  const auto falling = [&](const char* law) {
    return message(
        std::string("gravity = [0, 0, -9.81]\n[bodies.ball]\ntype = \"rigid\"\nmass = 2\ninertia = [1, 1, 1]\n"
                    "position = [0, 0, 1]\n[surfaces.ball]\nbody = \"ball\"\nshape = \"sphere\"\nradius = 0.1\n"
                    "[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n[contacts.landing]\n"
                    "surfaces = [\"ball\", \"floor\"]\nstiffness = 1e5\n") +
            law + "\n[integrator]\nend = 1\n[output]\nquantities = [\"ball.position\"]\n",
        {{"bodies.ball.mass"}});
  };
  expect(falling("law = \"impulse\""), "contacts.landing");
  expect(falling("law = \"impulse\""), "impulses");
  expect(message(dynamics::kPendulum, {{"bodies.bob.mass"}}), "no quantity");
  SimulationOptions options;
  options.restart = "there.restart";
  expect(message(text, {{"parameters.length"}}, options), "restart");
  EXPECT_FALSE(sensitivities("no such file.toml", {{"parameters.length"}}).status.ok());
}

// Times, tolerances and loads of the run stay what they are; a derivative by them would be a silent zero.
TEST(Sensitivities, WhatMovesTheRunItselfIsRefused) {
  const std::string text = R"(
[parameters]
k = 4
until = 1
[bodies.mass]
type = "point"
mass = 2
position = [1.5, 0, 0]
[forces.spring]
type = "spring"
a = { body = "ground" }
b = { body = "mass" }
stiffness = "k"
rest = 1
[output]
quantities = ["mass.position.x"]
)";
  const std::string motion = text + "[integrator]\nend = \"until + 1\"\n";
  const std::string rest = text + "[statics]\nload = \"until\"\n";
  const auto expect_refused = [](const std::string& model, const std::string& parameter, const std::string& section) {
    for (const SensitivityMethod method : {SensitivityMethod::forward, SensitivityMethod::adjoint}) {
      const SensitivityResult r = sensitivities_of_text(model, "model.toml", {{parameter}}, {}, method);
      EXPECT_EQ(r.status.code, StatusCode::invalid_input) << parameter;
      EXPECT_NE(r.status.message.find(section), std::string::npos) << r.status.message;
      EXPECT_NE(r.status.message.find("depends on " + parameter), std::string::npos) << r.status.message;
    }
  };
  expect_refused(motion, "parameters.until", "integrator");
  expect_refused(motion + "relative = 1e-5\n", "integrator.relative", "integrator");
  expect_refused(rest, "parameters.until", "statics");
  expect_refused(motion + "[solver]\nrefinement_target = 1e-12\n", "solver.refinement_target", "solver");
  const std::string written = dynamics::replaced(motion, "[output]\n", "[output]\ncsv_interval = \"until / 10\"\n");
  expect_refused(written, "parameters.until", "output");
  expect_refused(written, "output.csv_interval", "output");
  EXPECT_TRUE(sensitivities_of_text(motion, "model.toml", {{"parameters.k"}}).status.ok());
}

}  // namespace sensitivities_test
}  // namespace espalier
