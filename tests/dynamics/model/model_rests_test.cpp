// What runs leave behind and say: notices of rounding, pictures of earlier runs, restart after other splines, what may
// not depend on the state.
#include <fmt/format.h>

#include <algorithm>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

namespace fs = std::filesystem;

bool mentions(const std::vector<std::string>& notices, const std::string& text) {
  return std::any_of(notices.begin(), notices.end(),
                     [&](const std::string& n) { return n.find(text) != std::string::npos; });
}

std::string two_bodies(double speed) {
  return fmt::format(R"(
[bodies.a]
type = "rigid"
mass = 2
box = [0.3, 0.1, 0.2]
position = [0.37, 0.71, 1.3]
rotation = [0.3, 0.2, 0.1]
[bodies.b]
type = "rigid"
mass = 2
box = [0.3, 0.1, 0.2]
position = [0.97, 0.71, 1.3]
angular_velocity = [0, 0, {}]
[joints.between]
type = "spherical"
bodies = ["a", "b"]
at = [0.61, 0.73, 1.31]
[joints.hinge]
type = "spherical"
bodies = ["ground", "a"]
at = [0.11, 0.73, 1.31]
[initial]
velocities = "project"
[integrator]
method = "generalized-alpha"
step = 1e-5
steps = 300
)",
                     speed);
}

// At rest accelerations and reactions are nothing but rounding, and nobody wants to hear of it; in motion, steps of
// 1e-5 (rounding 1e-16 / h^2 = 1e-6) spoil accelerations of 1e-3 by a thousandth, and the notice says so.
TEST(RoundingNotice, IsNotGivenForBodiesAtRest) {
  const Simulation still = simulated(two_bodies(0)), slow = simulated(two_bodies(0.03));
  EXPECT_FALSE(mentions(still.summary().notices, "rounding shows"));
  EXPECT_TRUE(mentions(slow.summary().notices, "rounding shows"));
}

// A shorter run into the same folder leaves no pictures of the longer one, and nothing else is touched.
TEST(RunFilesOfEarlierRuns, PicturesThatAreNotInTheSeriesAnyMoreAreRemoved) {
  const ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path();
  options.set = {"output.vtu_interval=0.1", "integrator.end=1", "output.format=vtu"};
  static_cast<void>(simulated(kPendulum, options));
  std::ofstream(folder.path() + "/motion_0_999999.vtu") << "mine";
  const auto pictures = [&] {
    long count = 0;
    for (const auto& entry : fs::directory_iterator(folder.path()))
      if (entry.path().extension() == ".vtu") ++count;
    return count;
  };
  EXPECT_EQ(pictures(), 12);
  options.set[1] = "integrator.end=0.5";
  static_cast<void>(simulated(kPendulum, options));
  EXPECT_EQ(pictures(), 7);
  EXPECT_EQ(content_of(folder.path() + "/motion_0_999999.vtu"), "mine");
}

// The content of a spline's file belongs to the model that a restart file was written by; its name does not.
TEST(RestartWithSplines, ContentCountsAndNamesDoNot) {
  const ScratchFolder folder;
  const auto write = [&](const std::string& name, double y) {
    std::ofstream(folder.path() + "/" + name) << "-10,-1\n0,0\n10," << y << "\n";
  };
  const std::string model = folder.path() + "/model.toml";
  std::ofstream(model) << kPendulum << R"toml(
[splines.push]
file = "push.csv"
[forces.push]
type = "load"
a = { body = "bob" }
force = [0, "push(t)", 0]
)toml";
  write("push.csv", 1);
  SimulationOptions options;
  options.out = folder.path();
  {
    Simulation first(options);
    ASSERT_TRUE(first.load(model).ok() && first.run().ok());
  }
  options.restart = folder.path() + "/state.restart";
  options.until = 1.1;
  const auto status = [&] {
    Simulation next(options);
    const Status loaded = next.load(model);
    return loaded.ok() ? next.run() : loaded;
  };
  write("push.csv", 2);
  const Status changed = status();
  EXPECT_FALSE(changed.ok());
  EXPECT_NE(changed.message.find("splines.push.file (its content)"), std::string::npos) << changed.message;
  write("other.csv", 1);
  options.set = {"splines.push.file=\"other.csv\""};
  const Status renamed = status();
  EXPECT_TRUE(renamed.ok()) << renamed.message;
}

// Motions and pressures are functions of time alone; a quantity in them is refused with what takes one.
TEST(FunctionsOfTime, RefuseQuantitiesOfTheStateAndSayWhatTakesThem) {
  Simulation s;
  const Status status = s.load_text(R"(
[bodies.bob]
type = "rigid"
mass = 2
box = [0.1, 0.1, 0.1]
[joints.motor]
type = "rotation-motor"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
motion = "2*bob.position.x"
[integrator]
end = 1
)",
                                    "model.toml");
  EXPECT_EQ(status.code, StatusCode::invalid_input);
  for (const char* part : {"model.toml:11", "'bob.' begins a quantity", "function of t alone", "torque-motor"})
    EXPECT_NE(status.message.find(part), std::string::npos) << status.message;
}

// Truth: Newton on the whole system H = 0, with differences for its Jacobian. Friction makes F depend on the
// multipliers, and the free directions of the reduced iteration are those of K with that part.
TEST(FrictionWithTheFullSystem, AgreesWithTheReducedIteration) {
  std::vector<std::vector<double>> values;
  for (const char* iteration : {"reduced", "full-matched"}) {
    const Simulation s = simulated(fmt::format(R"(
gravity = [0, -9.81, 0]
[bodies.bob]
type = "rigid"
mass = 2
inertia = [0.01, 0.02, 0.03]
position = [0.8, -0.6, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
friction = {{ coefficient = 0.3, slip_speed = 0.05, radius = 0.1 }}
[integrator]
step = 2e-3
order = 2
steps = 20
end = 1
iteration = "{}"
refactor_rate = 1e-30   # a new K in every step, as the reference has
relative = 1e-10
absolute = 1e-12
[output]
quantities = ["bob.position", "bob.velocity", "hinge.force"]
)",
                                               iteration));
    values.emplace_back();
    for (const auto& [name, value] : s.summary().values) values.back().push_back(value);
  }
  ASSERT_EQ(values[0].size(), 9U);
  for (std::size_t k = 0; k < 9; ++k) EXPECT_NEAR(values[0][k], values[1][k], k < 6 ? 1e-12 : 1e-10) << k;
}

}  // namespace
}  // namespace espalier::dynamics
