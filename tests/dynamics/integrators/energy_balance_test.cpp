// What steps do to the energy. Truth: closed forms of conservative, damped and driven motions.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace energy_balance_test {

bool says_energy(const Simulation& run) {
  for (const std::string& notice : run.summary().notices)
    if (notice.find("energy that no force explains") != std::string::npos) return true;
  return false;
}

std::string oscillator(const std::string& force, const std::string& integrator) {
  return "[bodies.mass]\ntype = \"rigid\"\nmass = 2\nbox = [0.1, 0.1, 0.1]\nposition = [1.2, 0, "
         "0]\n[joints.rail]\ntype = "
         "\"prismatic\"\nbodies = [\"ground\", \"mass\"]\nat = [1, 0, 0]\naxis = [1, 0, 0]\n[forces.f]\na = { body = "
         "\"ground\" }\nb = { body = \"mass\" }\n" +
         force + "[integrator]\n" + integrator;
}

// Ten swings by generalized-alpha with 20 steps each, with and without numerical damping, and by BDF. Truth: the energy
// of the spring, k u^2 / 2 = 0.04 k, stays.
TEST(EnergyBalance, OfAFreeOscillation) {
  const double period = 2 * std::numbers::pi * std::sqrt(2.0 / 100);
  const std::string spring = "type = \"spring\"\nstiffness = 100\nrest = 1\n";
  const auto alpha = [&](double radius) {
    return simulated(oscillator(spring, fmt::format("method = \"generalized-alpha\"\nspectral_radius = {}\nstep = "
                                                    "{:.17g}\nend = {:.17g}\n",
                                                    radius, period / 20, 10 * period)));
  };
  const Simulation damped = alpha(0.3), kept = alpha(1);
  EXPECT_TRUE(says_energy(damped));
  EXPECT_LT(damped.summary().energy_gain, -0.02 * 2);
  EXPECT_NEAR(damped.summary().energy_work, 0, 1e-6);
  const SimulationSummary& s = damped.summary();
  EXPECT_NEAR(s.energy_gain,
              s.energy_end.kinetic + s.energy_end.potential - s.energy_begin.kinetic - s.energy_begin.potential, 1e-6);
  EXPECT_FALSE(says_energy(kept));
  EXPECT_LT(std::abs(kept.summary().energy_gain), 0.02);
  const Simulation bdf =
      simulated(oscillator(spring, fmt::format("relative = 1e-8\nabsolute = 1e-9\nend = {:.17g}\n", 10 * period)));
  EXPECT_FALSE(says_energy(bdf));
  EXPECT_LT(std::abs(bdf.summary().energy_gain), 1e-4);
}

// A beam with a weight at rest in its equilibrium, in micrometres: all that its energies do is rounding, which is the
// whole of what they change by. It was told as a gain of 100 %.
TEST(EnergyBalance, WhatRestsGainsNothing) {
  const Simulation run = simulated(
      "gravity = [0, -9.81e6, 0]\n[integrator]\nend = 1e-6\n[initial]\nstatics = true\n[bodies.w]\ntype = \"beam\"\n"
      "start = [0, 0, 0]\nend = [5e5, 0, 0]\nelements = 8\nheight = 3e3\nwidth = 2e3\n"
      "material = { young = 7e4, poisson = 0.3, density = 2.7e-15 }\n[bodies.b]\ntype = \"rigid\"\nmass = 0.02\n"
      "box = [2e4, 1e4, 1e4]\nposition = [5.1e5, 0, 0]\n[joints.c]\ntype = \"fixed\"\na = { body = \"ground\" }\n"
      "b = { body = \"w\", node = 1 }\n[joints.d]\ntype = \"fixed\"\na = { body = \"w\", node = -1 }\n"
      "b = { body = \"b\", point = [-1e4, 0, 0] }\n[forces.s]\ntype = \"spring\"\n"
      "a = { body = \"ground\", point = [5e5, 1e5, 0] }\nb = { body = \"b\" }\nstiffness = 30\ndamping = 0.01\n");
  EXPECT_FALSE(says_energy(run)) << run.summary().energy_gain;
}

// A damper takes all of the energy, which is no loss of the steps; and a motor brings some. Truth: what there was.
TEST(EnergyBalance, DampersAndMotorsExplainTheirWork) {
  const std::string fine = "relative = 1e-8\nabsolute = 1e-9\nend = 4\n";
  const Simulation damped = simulated(oscillator("type = \"spring\"\nstiffness = 100\nrest = 1\ndamping = 8\n", fine));
  EXPECT_NEAR(damped.summary().energy_work, -0.5 * 100 * 0.04, 2e-3);
  EXPECT_LT(std::abs(damped.summary().energy_gain), 2e-3);
  EXPECT_FALSE(says_energy(damped));
  const std::string rotor =
      "[bodies.rotor]\ntype = \"rigid\"\nmass = 1\ninertia = [1, 1, 2]\n[joints.axle]\ntype = \"revolute\"\nbodies = "
      "[\"ground\", \"rotor\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n[forces.motor]\ntype = \"torque-motor\"\nbodies = "
      "[\"ground\", \"rotor\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\ntorque = \"3*cos(t)\"\n[integrator]\nrelative = "
      "1e-8\nabsolute = 1e-9\nend = 1\n";
  const Simulation driven = simulated(rotor);
  const double speed = 1.5 * std::sin(1.0);
  EXPECT_NEAR(driven.summary().energy_work, 0.5 * 2 * speed * speed, 5e-3);  // trapezoids
  EXPECT_FALSE(says_energy(driven));
}

// Energy that impacts take is not that of the steps.
TEST(EnergyBalance, ImpactsAreNoSteps) {
  const std::string ball =
      "gravity = [0, 0, -10]\n[bodies.ball]\ntype = \"rigid\"\nmass = 1\nbox = [0.1, 0.1, 0.1]\nposition = [0, 0, "
      "1]\n[surfaces.ball]\nbody = \"ball\"\nshape = \"sphere\"\nradius = 0.1\n[surfaces.floor]\nbody = "
      "\"ground\"\nshape = "
      "\"plane\"\n[contacts.floor]\nsurfaces = [\"floor\", \"ball\"]\nlaw = \"impulse\"\nstiffness = 1e6\nrestitution "
      "= "
      "0.5\n[integrator]\nrelative = 1e-8\nabsolute = 1e-9\nend = 0.8\n";
  const Simulation run = simulated(ball);
  EXPECT_LT(run.summary().energy_end.kinetic + run.summary().energy_end.potential, 0.5 * 10);
  EXPECT_LT(std::abs(run.summary().energy_gain), 1e-5);
  EXPECT_FALSE(says_energy(run));
}

}  // namespace energy_balance_test
}  // namespace espalier::dynamics
