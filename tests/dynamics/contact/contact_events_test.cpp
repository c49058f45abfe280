// Events of contacts: when they close and open. Truth: closed forms.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace contact_events_test {

constexpr double kGravity = 9.81, kHeight = 0.5, kRadius = 0.1, kMass = 2, kStiffness = 1e5;

std::string ball(double end, const std::string& more) {
  return fmt::format(
      "gravity = [0, 0, -9.81]\n[bodies.ball]\ntype = \"rigid\"\nmass = {}\ninertia = [0.008, 0.008, 0.008]\nposition "
      "= [0, 0, {}]\n[surfaces.ball]\nbody = \"ball\"\nshape = \"sphere\"\nradius = {}\n[surfaces.floor]\nbody = "
      "\"ground\"\nshape = \"plane\"\n[contacts.bounce]\nsurfaces = [\"floor\", \"ball\"]\nstiffness = {}\n"
      "[integrator]\nend = {:.17g}\nrelative = 1e-11\nabsolute = 1e-11\n{}",
      kMass, kRadius + kHeight, kRadius, kStiffness, end, more);
}

// Free fall, then half a period of an oscillator and a little more, by turns.
TEST(ContactEvents, ImpactsOfABallCloseAndOpen) {
  const double v0 = std::sqrt(2 * kGravity * kHeight), omega = std::sqrt(kStiffness / kMass);
  const double touching = 2 * (std::numbers::pi - std::atan(v0 * omega / kGravity)) / omega;
  const double period = 2 * v0 / kGravity + touching;
  const Simulation run = simulated(ball(10 * period,
                                        "[events.down]\ncontact = \"bounce\"\nwhen = \"closes\"\ntolerance = 1e-10\n"
                                        "[events.up]\ncontact = \"bounce\"\nwhen = \"opens\"\ntolerance = 1e-10\n"));
  std::vector<double> down, up;
  for (const auto& e : run.summary().events) (e.name == "down" ? down : up).push_back(e.t);
  ASSERT_EQ(down.size(), 10U);
  ASSERT_EQ(up.size(), 11U);  // it is open at the start
  EXPECT_EQ(up[0], 0);
  for (std::size_t k = 0; k < 10; ++k) {
    EXPECT_NEAR(down[k], v0 / kGravity + static_cast<double>(k) * period, 1e-6 * period) << k;
    EXPECT_NEAR(up[k + 1], down[k] + touching, 1e-6 * period) << k;
  }
}

TEST(ContactEvents, StopAtTheImpactOfARope) {
  const std::string text =
      "gravity = [0, 0, -9.81]\n[bodies.rope]\ntype = \"cable\"\nstart = [0, 0, 0.12]\nend = [1, 0, 0.12]\naxial = "
      "1e4\nbending = 1\nmass_per_length = 0.5\n[surfaces.rope]\nbody = \"rope\"\nshape = \"line\"\nradius = "
      "0.02\n[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n[contacts.c]\nsurfaces = [\"rope\", "
      "\"floor\"]\nstiffness = 1e3\n[events.landing]\ncontact = \"c\"\nwhen = \"closes\"\nstop = true\ntolerance = "
      "1e-7\n[integrator]\nend = 1\n";
  const Simulation run = simulated(text);
  EXPECT_EQ(run.summary().stopped_by, "landing");
  EXPECT_NEAR(run.summary().t_end, std::sqrt(2 * 0.1 / kGravity), 2e-7);
}

TEST(ContactEvents, MistakesAreNamed) {
  const auto mistake = [](const std::string& more) {
    Simulation simulation;
    return simulation.load_text(ball(1, more), "model.toml").message;
  };
  EXPECT_NE(mistake("[events.e]\ncontact = \"bonce\"\nwhen = \"closes\"\n").find("no contact 'bonce'"),
            std::string::npos);
  EXPECT_NE(mistake("[events.e]\ncontact = \"bounce\"\nwhen = \"touches\"\n").find("opens"), std::string::npos);
  EXPECT_NE(mistake("[events.e]\ncontact = \"bounce\"\n").find("when"), std::string::npos);
}

}  // namespace contact_events_test
}  // namespace espalier::dynamics
