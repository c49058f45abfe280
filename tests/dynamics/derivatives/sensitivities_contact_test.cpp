// Derivatives through contacts that remember: friction that slips and sticks, restitution. Truth: closed forms.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"
#include "espalier/sensitivities.hpp"

namespace espalier {
namespace sensitivities_contact_test {

SensitivityResult differentiated(const std::string& text, const std::vector<SensitivityParameter>& parameters) {
  SensitivityResult result = sensitivities_of_text(text, "model.toml", parameters, {});
  EXPECT_TRUE(result.status.ok()) << result.status.message;
  return result;
}

/// Central difference of whole runs.
double difference(const std::string& text, const std::string& path, double value, double step, const std::string& of) {
  double ends[2];
  for (int a = 0; a < 2; ++a) {
    SimulationOptions options;
    options.set = {fmt::format("{}={:.17g}", path, a == 0 ? value - step : value + step)};
    ends[a] = dynamics::simulated(text, options).value(of);
  }
  return (ends[1] - ends[0]) / (2 * step);
}

// A ball on a rail is pressed on the floor by N = k p and slides: x = v t - mu N t^2 / (2 m), until it stops at
// v^2 m / (2 mu N) but for the stretch of its spring.
TEST(SensitivitiesOfContacts, FrictionSlidesAndSticks) {
  constexpr double kSpeed = 3, kFriction = 0.3, kNormal = 10;
  const auto slider = [&](double end, const std::string& integrator) {
    return fmt::format(
        "[bodies.slider]\ntype = \"rigid\"\nmass = 1\ninertia = [1, 1, 1]\nposition = [0, 0, 0.099]\n"
        "velocity = [{}, 0, 0]\n[joints.rail]\ntype = \"prismatic\"\nbodies = [\"ground\", \"slider\"]\nat = "
        "[0, 0, 0.099]\naxis = [1, 0, 0]\n[surfaces.slider]\nbody = \"slider\"\nshape = \"sphere\"\nradius = "
        "0.1\n[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n[contacts.c]\nsurfaces = [\"floor\", "
        "\"slider\"]\nstiffness = 1e4\nfriction = {}\ntangential_stiffness = 1e5\ntangential_damping = 300\n"
        "overlap = 1\n[integrator]\n{}\nend = {}\n[output]\nquantities = [\"slider.position.x\", "
        "\"c.friction_force\"]\n",
        kSpeed, kFriction, integrator, end);
  };
  const std::string x = "slider.position.x", friction = "contacts.c.friction", speed = "bodies.slider.velocity.0",
                    stiffness = "contacts.c.stiffness";
  constexpr double kOn = 0.8;
  const SensitivityResult slides =
      differentiated(slider(kOn, "relative = 1e-8\nabsolute = 1e-9"), {{friction}, {speed}, {stiffness}});
  EXPECT_NEAR(slides.derivative(x, friction), -0.5 * kNormal * kOn * kOn, 1e-5);
  EXPECT_NEAR(slides.derivative(x, speed), kOn, 1e-6);
  EXPECT_NEAR(slides.derivative(x, stiffness), -0.5 * kFriction * 1e-3 * kOn * kOn, 1e-9);
  EXPECT_NEAR(slides.derivative("c.friction_force", friction), kNormal, 1e-6);
  EXPECT_LT(slides.defect, 1e-6);

  const std::string whole = slider(1.2, "method = \"generalized-alpha\"\nspectral_radius = 0.5\nstep = 1e-3");
  const SensitivityResult rests = differentiated(whole, {{friction}, {speed}});
  const double stop = kSpeed * kSpeed / (2 * kFriction * kNormal);
  EXPECT_NEAR(rests.value(x), stop, 2e-3 * stop);
  EXPECT_NEAR(rests.derivative(x, friction), -stop / kFriction, 2e-2 * stop / kFriction);
  EXPECT_NEAR(rests.derivative(x, speed), 2 * stop / kSpeed, 2e-2 * 2 * stop / kSpeed);
  EXPECT_NEAR(rests.derivative(x, friction), difference(whole, friction, kFriction, 1e-3, x), 2e-2 * stop / kFriction);
  EXPECT_NEAR(rests.derivative("c.friction_force", friction), 0, 1e-2);  // nothing pulls any more
}

// A block that friction stops at x = v^2 / (2 mu g), long before the end: dx/dv = v / (mu g), dx/dmu = -x / mu, at any
// tolerance; a run beside it finds nothing to say.
TEST(SensitivitiesOfContacts, OfABlockThatHasStopped) {
  constexpr double kFriction = 0.2, kGravity = 9.81;
  for (const double tolerance : {1e-5, 1e-6, 1e-8}) {
    const SensitivityResult r = differentiated(
        fmt::format("gravity = [0, 0, -9.81]\n[bodies.block]\ntype = \"rigid\"\nmass = 2\ninertia = [1e6, 1e6, "
                    "1e6]\nposition = [0, 0, {:.17g}]\nvelocity = [1, 0, 0]\n[surfaces.block]\nbody = "
                    "\"block\"\nshape = \"sphere\"\nradius = 0.1\n[surfaces.floor]\nbody = \"ground\"\nshape = "
                    "\"plane\"\n[contacts.rub]\nsurfaces = [\"floor\", \"block\"]\nstiffness = 1e7\nfriction = "
                    "0.2\ntangential_damping = 1e3\n[integrator]\nend = 1\nrelative = {:g}\nabsolute = "
                    "{:g}\n[output]\nquantities = [\"block.position.x\"]\n",
                    0.1 - 2 * kGravity / 1e7, tolerance, tolerance / 100),
        {{"bodies.block.velocity.0"}, {"contacts.rub.friction"}});
    const double stop = 1 / (2 * kFriction * kGravity);
    EXPECT_NEAR(r.derivative("block.position.x", "bodies.block.velocity.0"), 2 * stop, 2e-3 * stop) << tolerance;
    EXPECT_NEAR(r.derivative("block.position.x", "contacts.rub.friction"), -stop / kFriction, 1e-2 * stop) << tolerance;
    EXPECT_LT(r.defect, 1e-6);
    for (const std::string& notice : r.summary.notices)
      EXPECT_EQ(notice.find("derivatives"), std::string::npos) << notice;
  }
}

// What met the floor with v parts with r v: dz/dr = v s, dz/dh = r g s / v - (r v - g s) / v, s since then; both but
// for the time of the touch.
TEST(SensitivitiesOfContacts, Restitution) {
  constexpr double kGravity = 9.81, kHeight = 0.5, kLater = 0.2, kRest = 0.7;
  const double speed = std::sqrt(2 * kGravity * kHeight), first = speed / kGravity;
  const std::string text = fmt::format(
      "gravity = [0, 0, -{}]\n[bodies.ball]\ntype = \"rigid\"\nmass = 2\ninertia = [0.01, 0.01, 0.01]\n"
      "position = [0, 0, {}]\n[surfaces.ball]\nbody = \"ball\"\nshape = \"sphere\"\nradius = 0.1\n"
      "[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n[contacts.c]\nsurfaces = [\"floor\", "
      "\"ball\"]\nstiffness = 1e6\nrestitution = {}\n[integrator]\nend = {:.17g}\nrelative = 1e-9\n"
      "absolute = 1e-10\n[output]\nquantities = [\"ball.position.z\"]\n",
      kGravity, 0.1 + kHeight, kRest, first + kLater);
  const std::string z = "ball.position.z", restitution = "contacts.c.restitution", height = "bodies.ball.position.2";
  const SensitivityResult r = differentiated(text, {{restitution}, {height}});
  EXPECT_NEAR(r.derivative(z, restitution), speed * kLater, 0.05 * speed * kLater);
  EXPECT_NEAR(r.derivative(z, restitution), difference(text, restitution, kRest, 1e-3, z), 5e-3);
  const double by_height = kRest * kGravity / speed * kLater - (kRest * speed - kGravity * kLater) / speed;
  EXPECT_NEAR(r.derivative(z, height), by_height, 0.1 * by_height);
}

}  // namespace sensitivities_contact_test
}  // namespace espalier
