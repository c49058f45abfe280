// Velocities at the start: those that are given stay, the others follow. Truth: kinematics of a slider crank.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace start_velocities_test {

/// Crank of 0.15 from the origin upwards, rod of 0.5 to the slider on the x axis.
std::string slider_crank(const std::string& crank, const std::string& rod, const std::string& initial) {
  const double x = std::sqrt(0.25 - 0.0225);
  return fmt::format(
      "[bodies.crank]\ntype = \"rigid\"\nmass = 0.3\ninertia = [1e-3, 1e-3, 1e-3]\nposition = [0, 0.075, 0]\n{}\n"
      "[bodies.rod]\ntype = \"rigid\"\nmass = 1.5\ninertia = [1e-3, 0.03, 0.03]\nposition = [{:.17g}, 0.075, 0]\n{}\n"
      "rotation = [0, 0, {:.17g}]\n[bodies.slider]\ntype = \"rigid\"\nmass = 2\ninertia = [1e-2, 1e-2, 1e-2]\nposition "
      "= "
      "[{:.17g}, 0, 0]\n[joints]\nbearing = {{ type = \"revolute\", bodies = [\"ground\", \"crank\"], at = [0, 0, 0], "
      "axis "
      "= [0, 0, 1] }}\npin = {{ type = \"revolute\", bodies = [\"crank\", \"rod\"], at = [0, 0.15, 0], axis = [0, 0, "
      "1] "
      "}}\nwrist = {{ type = \"revolute\", bodies = [\"rod\", \"slider\"], at = [{:.17g}, 0, 0], axis = [0, 0, 1] "
      "}}\nguide "
      "= {{ type = \"prismatic\", bodies = [\"ground\", \"slider\"], at = [{:.17g}, 0, 0], axis = [1, 0, 0] "
      "}}\n[initial]\n{}\n[integrator]\nrelative = 1e-8\nabsolute = 1e-9\nend = 1e-4\n",
      crank, x / 2, rod, -std::asin(0.3), x, x, x, initial);
}

/// The value of the state at the start.
double at_start(const std::string& text, const std::string& quantity, std::vector<std::string>& notices) {
  Simulation run;
  const Status status = run.load_text(text, "crank.toml");
  EXPECT_TRUE(status.ok()) << status.message;
  notices = run.summary().notices;
  return status.ok() ? run.value(quantity) : NAN;
}

bool says(const std::vector<std::string>& notices, const std::string& word) {
  for (const std::string& notice : notices)
    if (notice.find(word) != std::string::npos) return true;
  return false;
}

TEST(StartVelocities, GivenOnesStayAndOthersFollow) {
  std::vector<std::string> notices;
  for (const std::string initial : {"", "velocities = \"project\""})
    for (const std::string crank : {"velocity = [-11.25, 0, 0]\nangular_velocity = [0, 0, 150]",
                                    "angular_velocity = [0, 0, 150]", "velocity = [-11.25, 0, 0]"}) {
      const std::string text = slider_crank(crank, "", initial);
      EXPECT_NEAR(at_start(text, "crank.angular_velocity.z", notices), 150, 1e-8) << initial << crank;
      // The crank stands upright: rod and slider move along x alone, without turning.
      EXPECT_NEAR(at_start(text, "slider.velocity.x", notices), -22.5, 1e-9);
      EXPECT_NEAR(at_start(text, "rod.velocity.x", notices), -22.5, 1e-9);
      EXPECT_NEAR(at_start(text, "rod.angular_velocity.z", notices), 0, 1e-9);
      EXPECT_TRUE(says(notices, "follow from the others")) << initial << crank;
    }
}

TEST(StartVelocities, ThatContradictAreRefusedOrSaid) {
  const std::string crank = "angular_velocity = [0, 0, 150]", rod = "velocity = [10, 0, 0]";  // it must be -22.5
  Simulation run;
  const Status status = run.load_text(slider_crank(crank, rod, ""), "crank.toml");
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  EXPECT_NE(status.message.find("the velocity of body"), std::string::npos) << status.message;
  std::vector<std::string> notices;
  at_start(slider_crank(crank, rod, "velocities = \"project\""), "crank.angular_velocity.z", notices);
  EXPECT_TRUE(says(notices, "do not fit the joints and were changed"));
}

TEST(StartVelocities, WithoutAnyNothingIsSaid) {
  std::vector<std::string> notices;
  EXPECT_NEAR(at_start(slider_crank("", "", ""), "slider.velocity.x", notices), 0, 1e-12);
  EXPECT_FALSE(says(notices, "initial velocities"));
}

}  // namespace start_velocities_test
}  // namespace espalier::dynamics
