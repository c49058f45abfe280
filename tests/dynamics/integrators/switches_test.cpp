// Steps that must not pass a switch unseen: long smooth motions before and after it. Truth: closed forms, and a small
// Runge-Kutta integration of the law where there is none.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "dynamics/dae/switching.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace switches_test {

constexpr double kGravity = 9.81;
const std::string kFloor = "[surfaces.floor]\nbody = \"ground\"\nshape = \"plane\"\n";

std::string tolerances(double end, double relative, double absolute) {
  return fmt::format("[integrator]\nend = {:.17g}\nrelative = {:g}\nabsolute = {:g}\n", end, relative, absolute);
}

/// A body with a sphere of 0.1 on a plane of stiffness 1e7, at rest in z.
std::string on_floor(double inertia, double speed, const std::string& law) {
  const double sink = 2 * kGravity / 1e7;
  return fmt::format(
             "gravity = [0, 0, -9.81]\n[bodies.ball]\ntype = \"rigid\"\nmass = 2\ninertia = [{0}, {0}, {0}]\nposition "
             "= [0, 0, {1:.17g}]\nvelocity = [{2}, 0, 0]\n[surfaces.ball]\nbody = \"ball\"\nshape = \"sphere\"\nradius "
             "= 0.1\n[contacts.rub]\nsurfaces = [\"floor\", \"ball\"]\nstiffness = 1e7\n{3}\n",
             inertia, 0.1 - sink, speed, law) +
         kFloor;
}

/// Both absolute tolerances of every relative one from 1e-4 to 1e-12.
void for_tolerances(const std::function<void(double relative, double absolute)>& test) {
  for (int digits = 4; digits <= 12; ++digits)
    for (const double share : {1.0, 1e-2}) test(std::pow(10, -digits), share * std::pow(10, -digits));
}

// v0 / (mu g) later it rests at v0^2 / (2 mu g); great inertia keeps it from rolling. The spring that holds gives way
// by mu m g / k_t = 5e-7 at either end.
TEST(Switches, BlockSlidesToRestAtEveryTolerance) {
  const double rest = 1 / (2 * 0.2 * kGravity);
  for_tolerances([&](double relative, double absolute) {
    const Simulation s =
        simulated(on_floor(1e6, 1, "friction = 0.2\ntangential_damping = 1e3") + tolerances(1, relative, absolute));
    EXPECT_NEAR(s.value("ball.position.x"), rest, 2e-6 + 30 * relative) << relative << ", " << absolute;
    EXPECT_NEAR(s.value("ball.velocity.x"), 0, 1e-6 + 30 * relative) << relative << ", " << absolute;
  });
}

// It slips for 2 v0 / (7 mu g), and then rolls with 5/7 of its speed.
TEST(Switches, BallBeginsToRollAtEveryTolerance) {
  constexpr double kFriction = 0.1, kEnd = 0.5;
  const double slips = 2 / (7 * kFriction * kGravity),
               x = slips - 0.5 * kFriction * kGravity * slips * slips + 5.0 / 7 * (kEnd - slips);
  for_tolerances([&](double relative, double absolute) {
    const Simulation s = simulated(on_floor(0.008, 1, "friction = 0.1\ntangential_damping = 2e3") +
                                   tolerances(kEnd, relative, absolute));
    EXPECT_NEAR(s.value("ball.position.x"), x, 3e-6 + 30 * relative) << relative << ", " << absolute;
    EXPECT_NEAR(s.value("ball.angular_velocity.y"), 50.0 / 7, 4e-5 + 300 * relative) << relative << ", " << absolute;
  });
}

std::string free_mass(const std::string& more) {
  return "[bodies.m]\ntype = \"rigid\"\nmass = 2\ninertia = [1, 1, 1]\n" + more;
}

// A blow of a millisecond in a motion without any other force: the step before it would be seconds long.
TEST(Switches, ShortBlowsAreMet) {
  struct Blow {
    const char* factor;
    double impulse;
  };
  const std::string spline =
      "[splines.hit]\nkind = \"linear\"\noutside = \"constant\"\npoints = [[0, 0], [5, 0], [5.0005, 100], [5.001, "
      "0]]\n";
  for (const Blow& blow :
       {Blow{"100*(step(t, 5, 0, 5.0001, 1) - step(t, 5.0009, 0, 5.001, 1))", 0.09},
        Blow{"100*max(0, 1 - abs(t - 5)/0.0005)", 0.05}, Blow{"100*max(0, sign(0.0005 - abs(t - 5)))", 0.1},
        Blow{"100*(min(max(t - 5, 0), 0.001) - min(max(t - 5.001, 0), 0.001))/0.001", 0.1},
        Blow{"100*(floor((t + 1)/6) - floor((t + 0.999)/6))", 0.1}, Blow{"hit(t)", 0.05}}) {
    for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) {
      const Simulation s = simulated(free_mass("[forces.blow]\ntype = \"load\"\na = { body = \"m\" }\nforce = [\"") +
                                     blow.factor + "\", 0, 0]\n" + spline + tolerances(8, tolerance, tolerance));
      EXPECT_NEAR(s.value("m.velocity.x"), blow.impulse / 2, 200 * tolerance + 1e-9)
          << blow.factor << ", " << tolerance;
      EXPECT_LT(s.summary().steps, 3000) << blow.factor;
    }
  }
}

// Fields of the place: a field that is passed in a millisecond and of which neither end of a long step knows. The work
// of the force over 0.002 m is that of v^2.
TEST(Switches, NarrowFieldsAreMet) {
  const std::string field = "100*max(0, 1 - abs(m.position.x - 5)/0.001)";
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    const Simulation s = simulated(
        free_mass("velocity = [1, 0, 0]\n[forces.field]\ntype = \"load\"\na = { body = \"m\" }\nforce = [\"") + field +
        "\", 0, 0]\n" + tolerances(8, tolerance, tolerance));
    EXPECT_NEAR(s.value("m.velocity.x"), std::sqrt(1 + 0.1), 200 * tolerance) << tolerance;
  }
}

/// A throw along x against gravity, so that its top lies `share` of its height beyond `at` = (1 - share) of it.
struct Throw {
  double speed = 10, height = speed * speed / (2 * kGravity), share = 0.02, at = (1 - share) * height;
  /// Where it is at the end, turned round by a spring of 1e6 N/m with 2 kg.
  [[nodiscard]] double place(double end) const {
    const double v = speed * std::sqrt(share), omega = std::sqrt(1e6 / 2);
    const double touches =
        (std::numbers::pi - 2 * std::atan2(kGravity / omega, v)) / omega;  // gravity helps the spring
    const double falls = end - (speed - v) / kGravity - touches;
    return at - v * falls - 0.5 * kGravity * falls * falls;
  }
};

// What is touched at the top of a parabola, where both ends of a long step are far below.
TEST(Switches, StopsAndCeilingsAreTouchedAtTheTop) {
  const Throw up;
  const std::string body = "gravity = [-9.81, 0, 0]\n" + free_mass(fmt::format("velocity = [{}, 0, 0]\n", up.speed));
  const std::string rail = fmt::format(
      "[joints.rail]\ntype = \"prismatic\"\nbodies = [\"ground\", \"m\"]\nat = [0, 0, 0]\naxis = [1, 0, 0]\nlimits = "
      "{{ "
      "upper = {:.17g}, stiffness = 1e6, smoothing = 1e-7 }}\n",
      up.at);
  const std::string ceiling = fmt::format(
      "[surfaces.m]\nbody = \"m\"\nshape = \"sphere\"\nradius = 0.1\n[surfaces.ceiling]\nbody = \"ground\"\nshape = "
      "\"plane\"\nnormal = [-1, 0, 0]\npoint = [{:.17g}, 0, 0]\n[contacts.c]\nsurfaces = [\"m\", "
      "\"ceiling\"]\nstiffness "
      "= 1e6\n",
      up.at + 0.1);
  for (const std::string& kind : {rail, ceiling})
    for (const double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) {
      const Simulation s = simulated(body + kind + tolerances(1.8, tolerance, tolerance));
      EXPECT_NEAR(s.value("m.position.x"), up.place(1.8), 1e-5 + 100 * tolerance) << kind << tolerance;
    }
}

// The same with an event, and with impulses.
TEST(Switches, EventsAndImpulsesAreMetAtTheTop) {
  const Throw up;
  const std::string body = "gravity = [-9.81, 0, 0]\n" + free_mass(fmt::format("velocity = [{}, 0, 0]\n", up.speed));
  const Simulation event = simulated(body + fmt::format("[events.high]\nwhen = \"m.position.x > {:.17g}\"\n", up.at) +
                                     tolerances(2, 1e-6, 1e-6));
  ASSERT_EQ(event.summary().events.size(), 1U);
  EXPECT_NEAR(event.summary().events[0].t, up.speed * (1 - std::sqrt(up.share)) / kGravity, 1e-5);
  const Simulation impulse = simulated(
      body +
      fmt::format(
          "[surfaces.m]\nbody = \"m\"\nshape = \"sphere\"\nradius = 0.1\n[surfaces.ceiling]\nbody = "
          "\"ground\"\nshape = \"plane\"\nnormal = [-1, 0, 0]\npoint = [{:.17g}, 0, 0]\n[contacts.c]\nsurfaces = "
          "[\"m\", \"ceiling\"]\nlaw = \"impulse\"\nrestitution = 1\nstiffness = 1e6\n",
          up.at + 0.1) +
      tolerances(1.8, 1e-6, 1e-6));
  const double v = up.speed * std::sqrt(up.share), falls = 1.8 - (up.speed - v) / kGravity;
  EXPECT_NEAR(impulse.value("m.position.x"), up.at - v * falls - 0.5 * kGravity * falls * falls, 1e-5);
}

// A ball that flies against a wall thinner than a step is long.
TEST(Switches, ThinWallsAreNotPassed) {
  for (const double speed : {0.3, 3.0, 10.0})
    for (const double tolerance : {1e-4, 1e-8}) {
      const double end = 10 / speed, touches = std::numbers::pi * std::sqrt(2 / 1e7), meets = (1 - 0.03) / speed;
      const Simulation s = simulated(
          free_mass(fmt::format("position = [-1, 0, 0]\nvelocity = [{}, 0, 0]\n", speed)) +
          "[surfaces.m]\nbody = \"m\"\nshape = \"sphere\"\nradius = 0.02\n[surfaces.wall]\nbody = \"ground\"\nshape = "
          "\"box\"\nsize = [0.02, 1, 1]\n[contacts.c]\nsurfaces = [\"m\", \"wall\"]\nstiffness = 1e7\n" +
          tolerances(end, tolerance, tolerance));
      EXPECT_NEAR(s.value("m.velocity.x"), -speed, (1e-5 + 100 * tolerance) * std::max(1.0, speed)) << speed;
      EXPECT_NEAR(s.value("m.position.x"), -0.03 - speed * (end - meets - touches), 1e-4 + 1000 * tolerance) << speed;
    }
}

// A soft floor that is met in a long step, faster than the step began: what is drawn down to it, and no farther, leaves
// with its part of the speed of the impact.
TEST(Switches, RestitutionIsOfTheSpeedOfTheImpact) {
  for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
    const Simulation s = simulated(
        free_mass("position = [0, 0, 2.1]\nvelocity = [0, 0, -1]\n") + kFloor +
        "[forces.pull]\ntype = \"load\"\na = { body = \"m\" }\nforce = [0, 0, \"-8*max(0, sign(m.position.z - "
        "0.1))\"]\n"
        "[surfaces.m]\nbody = \"m\"\nshape = \"sphere\"\nradius = 0.1\n[contacts.c]\nsurfaces = [\"floor\", \"m\"]\n"
        "stiffness = 20\nrestitution = 0.5\n[events.leaves]\nwhen = \"min(m.position.z - 0.1, m.velocity.z) > 0\"\n"
        "stop = true\ntolerance = 1e-9\n" +
        tolerances(20, tolerance, tolerance));
    EXPECT_NEAR(s.value("m.velocity.z"), 0.5 * std::sqrt(1 + 2 * 4 * 2), 2e-3 + 30 * tolerance) << tolerance;
  }
}

/// x at the end of m x'' = k (u t - x) - mu(x') N from rest: sticks until k u t = static N, then by Runge and Kutta.
double stick_slip(double mass, double stiffness, double press, double speed, double end) {
  const auto mu = [&](double v) { return 0.2 + 0.2 * std::exp(-v * v / (speed * speed)); };
  const auto acceleration = [&](double t, double x, double v) { return (stiffness * (t - x) - mu(v) * press) / mass; };
  double t = 0.4 * press / stiffness + 1e-9, x = 0, v = 1e-9;
  const double h = 2e-7;
  while (t < end) {
    const double k1 = acceleration(t, x, v), k2 = acceleration(t + h / 2, x + h / 2 * v, v + h / 2 * k1),
                 k3 = acceleration(t + h / 2, x + h / 2 * v + h * h / 4 * k1, v + h / 2 * k2),
                 k4 = acceleration(t + h, x + h * v + h * h / 2 * k2, v + h * k3);
    x += h * v + h * h / 6 * (k1 + k2 + k3);
    v += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    t += h;
    if (v < 0) break;
  }
  return x;
}

// Break-away on the falling branch, whose growth implicit steps would damp.
TEST(Switches, StribeckBreaksAwayInTimeAtAnySlipSpeed) {
  const double truth = stick_slip(1, 100, kGravity, 1e-3, 0.2);
  for (const double slip : {1e-5, 1e-6, 1e-7}) {
    const Simulation s = simulated(
        "gravity = [0, 0, -9.81]\n[bodies.m]\ntype = \"rigid\"\nmass = 1\ninertia = [1, 1, 1]\n[joints.rail]\ntype = "
        "\"prismatic\"\nbodies = [\"ground\", \"m\"]\nat = [0, 0, 0]\naxis = [1, 0, 0]\n" +
        fmt::format("friction = {{ coefficient = 0.2, static = 0.4, stribeck_speed = 1e-3, slip_speed = {} }}\n",
                    slip) +
        "[forces.pull]\ntype = \"load\"\na = { body = \"m\" }\nforce = [\"100*(t - m.position.x)\", 0, 0]\n" +
        tolerances(0.2, 1e-8, 1e-9));
    EXPECT_NEAR(s.value("m.position.x"), truth, 2e-3 * truth + 30 * slip) << slip;
  }
}

TEST(Switches, ContactsBreakAwayByTheirStaticCoefficient) {
  const double truth = stick_slip(2, 100, 2 * kGravity, 1e-3, 0.3);
  for (const double tolerance : {1e-6, 1e-8}) {
    const Simulation s =
        simulated(on_floor(1e6, 0, "friction = 0.2\nstatic = 0.4\nstribeck_speed = 1e-3\ntangential_damping = 1e3") +
                  "[forces.pull]\ntype = \"load\"\na = { body = \"ball\" }\nforce = [\"100*(t - ball.position.x)\", 0, "
                  "0]\n" +
                  tolerances(0.3, tolerance, tolerance));
    EXPECT_NEAR(s.value("ball.position.x"), truth, 3e-3 * truth) << tolerance;
  }
}

/// A step whose branch is f(share), of time alone.
double share_of(const std::function<double(double)>& f, bool levels = false) {
  State begin, end;
  end.t = 1;
  const StepPath path(
      begin, end,
      [](double t) {
        State s;
        s.t = t;
        return s;
      },
      0, 0);
  return first_unseen(path, [&](const StateView& s, Branches& out) { out.push_back({f(s.t), levels, false}); });
}

TEST(Switches, TwoInAStepAreDivided) {
  EXPECT_EQ(share_of([](double t) { return t - 0.3; }), 1);
  EXPECT_EQ(share_of([](double t) { return t + 1; }), 1);
  EXPECT_EQ(share_of([](double) { return 0.0; }), 1);
  for (const double width : {0.3, 0.1, 1e-2, 1e-3}) {
    const double top = share_of([&](double t) { return width * width - (t - 0.4) * (t - 0.4); });
    EXPECT_NEAR(top, 0.4, width) << width;
  }
  const double between = share_of([](double t) { return 1000 * (t - 0.5); }, true);
  EXPECT_GT(between, 0);
  EXPECT_LT(between, 0.01);
  EXPECT_EQ(share_of([](double t) { return 0.5 + t; }, true), 1);
}

}  // namespace switches_test
}  // namespace espalier::dynamics
