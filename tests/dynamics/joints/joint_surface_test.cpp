// Points on surfaces. Truth: the spherical pendulum as a link, closed forms of circles in bowls, and of friction on a
// wall.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace joint_surface_test {

constexpr double kPi = std::numbers::pi;
const std::string kFine = "[integrator]\nrelative = 1e-9\nabsolute = 1e-11\n";

TEST(PointOnSurface, BobOnASphereIsASphericalPendulum) {
  const std::string bob =
      "gravity = [0, 0, -10]\n[bodies.bob]\ntype = \"point\"\nmass = 2\nposition = [0.6, 0, -0.8]\nvelocity = [0, 2, "
      "0]\n";
  const std::string pair = "a = { body = \"ground\" }\nb = { body = \"bob\" }\n";
  const Simulation link = simulated(bob + "[joints.link]\ntype = \"distance\"\n" + pair + kFine + "end = 2\n");
  for (const std::string shape :
       {"shape = \"sphere\"\nradius = 1\n", "shape = \"ellipsoid\"\nhalf_axes = [1, 1, 1]\n"}) {
    const Simulation s =
        simulated(bob + "[joints.bowl]\ntype = \"point-on-surface\"\n" + pair + shape + kFine + "end = 2\n");
    for (const char* x : {"x", "y", "z"})
      EXPECT_NEAR(s.value(std::string("bob.position.") + x), link.value(std::string("bob.position.") + x), 1e-6);
    EXPECT_NEAR(s.value("bowl.force.norm"), link.value("link.force.norm"), 1e-5);
    EXPECT_EQ(s.summary().degrees_of_freedom, 2);
  }
}

TEST(PointOnSurface, CirclesInBowlsOfAllForms) {
  // Round at height h with slope f': v^2 = g r f'(r); N = m g sqrt(1 + f'^2).
  struct Bowl {
    std::string shape;
    double r, z, slope;
  };
  std::string grid = "shape = \"heights\"\nx = [-2, -1, 0, 1, 2]\ny = [-2, -1, 0, 1, 2]\nheights = [";
  for (int i = -2; i <= 2; ++i) {
    grid += "[";
    for (int j = -2; j <= 2; ++j) grid += fmt::format("{}, ", 0.5 * (i * i + j * j));
    grid += "], ";
  }
  grid += "]\n";
  const std::vector<Bowl> bowls = {
      {grid, 0.7, 0.245, 0.7},
      {"shape = \"cone\"\nangle = \"atan(2)\"\n", 0.8, 0.4, 0.5},
      {"shape = \"torus\"\nradius = 2\nrim = 0.5\n", 2.3, -0.4, 0.75},
      {"shape = \"ellipsoid\"\nhalf_axes = [2, 2, 1]\n", 1.2, -0.8, 0.375},
  };
  for (const Bowl& b : bowls) {
    const double v = std::sqrt(10 * b.r * b.slope);
    const Simulation s =
        simulated(fmt::format("gravity = [0, 0, -10]\n[bodies.bob]\ntype = \"point\"\nmass = 2\nposition = [{}, 0, "
                              "{}]\nvelocity = [0, {:.17g}, "
                              "0]\n[joints.bowl]\ntype = \"point-on-surface\"\na = {{ body = \"ground\" }}\nb = {{ "
                              "body = \"bob\" }}\n{}{}end = "
                              "{:.17g}\n",
                              b.r, b.z, v, b.shape, kFine, 2 * kPi * b.r / v));
    EXPECT_NEAR(s.value("bob.position.x"), b.r, 2e-5) << b.shape;
    EXPECT_NEAR(s.value("bob.position.y"), 0, 1e-4) << b.shape;
    EXPECT_NEAR(s.value("bob.position.z"), b.z, 2e-5) << b.shape;
    EXPECT_NEAR(s.value("bowl.force.norm"), 20 * std::sqrt(1 + b.slope * b.slope), 1e-3) << b.shape;
  }
  // On the inside of a cylinder, with friction: the wall's force m v^2 / r slows it down, v = v_0 exp(-mu angle).
  const Simulation wall = simulated(
      "gravity = [0, 0, 0]\n[bodies.bob]\ntype = \"point\"\nmass = 2\nposition = [1.5, 0, 0]\nvelocity = [0, 3, "
      "0]\n[joints.wall]\ntype = \"point-on-surface\"\na = { body = \"ground\" }\nb = { body = \"bob\" }\nshape = "
      "\"cylinder\"\nradius = 1.5\nfriction = { coefficient = 0.2, slip_speed = 1e-4 }\n" +
      kFine + "end = 2\n");
  const double speed = 3 / (1 + 0.2 * 3 * 2 / 1.5);  // v' = -mu v^2 / r
  EXPECT_NEAR(wall.value("bob.velocity.norm"), speed, 1e-6);
  EXPECT_NEAR(wall.value("wall.friction_force"), 0.2 * 2 * speed * speed / 1.5, 1e-6);
}

}  // namespace joint_surface_test
}  // namespace espalier::dynamics
