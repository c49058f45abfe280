// Models as FMUs, run by our own reader of FMUs, which knows nothing of them. The truth is the simulator itself,
// stepped to the same times.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <thread>

#include "espalier/dynamics.hpp"
#include "espalier/fmu.hpp"
#include "fmi/foreign.hpp"
#include "fmus.hpp"

namespace espalier::fmi {
namespace {

constexpr const char* kPendulum = R"(
gravity = [0, -9.81, 0]
units = "SI"
[parameters]
mass = 2
length = 0.7
[inputs]
torque = 0.5
[bodies.bob]
type = "rigid"
mass = "mass"
inertia = [0.01, 0.01, 0.01]
position = ["length", 0, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "bob"]
axis = [0, 0, 1]
at = [0, 0, 0]
[forces.drive]
type = "torque-motor"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
torque = "inputs.torque"
[integrator]
end = 1
method = "generalized-alpha"
step = 0.005
[output]
quantities = ["hinge.angle", "hinge.angular_speed", "hinge.force.y", "bob.acceleration.x"]
)";

FmuOptions with_library(int version) {
  FmuOptions o;
  o.version = version;
  o.library = TEST_FMU_LIBRARY;
  return o;
}

std::unique_ptr<ForeignFmu> load_file(const std::string& path) {
  return ForeignFmu::load("model", path, bytes_of_file(path));
}

class ExportedFmu : public ::testing::TestWithParam<int> {
 protected:
  [[nodiscard]] std::string written(const std::string& text, FmuOptions options) const {
    const FmuResult r = export_fmu_of_text(text, folder_ / "model.toml", folder_ / "model", options);
    EXPECT_TRUE(r.status.ok()) << r.status.message;
    EXPECT_EQ(r.path, folder_ / "model.fmu");
    EXPECT_EQ(r.bytes, bytes_of_file(r.path).size());
    return r.path;
  }
  /// The pendulum's FMU, made once for each version.
  [[nodiscard]] std::string pendulum() const {
    static std::map<int, std::string> made;
    std::string& bytes = made[GetParam()];
    if (bytes.empty()) bytes = bytes_of_file(written(kPendulum, with_library(GetParam())));
    write_file(folder_ / "model.fmu", bytes);
    return folder_ / "model.fmu";
  }
  [[nodiscard]] std::string refused(const std::string& text, FmuOptions options) const {
    const FmuResult r = export_fmu_of_text(text, folder_ / "model.toml", folder_ / "model", options);
    EXPECT_FALSE(r.status.ok());
    EXPECT_FALSE(std::filesystem::exists(folder_ / "model.fmu"));
    return r.status.message;
  }
  TestFolder folder_;
};

TEST_P(ExportedFmu, StepsAsTheSimulator) {
  const auto fmu = load_file(pendulum());
  const ModelDescription& d = fmu->description();
  EXPECT_TRUE(d.serializes_state);
  SimulationOptions options;
  options.set = {"parameters.length=0.9", "inputs.torque=-1"};
  Simulation truth(options);
  ASSERT_TRUE(truth.load_text(kPendulum, "model.toml").ok());
  fmu->begin(0, {{*d.find("parameters.length"), 0.9}, {*d.find("torque"), -1.0}});
  fmu->end_initialization();
  double t = 0;
  for (int k = 0; k < 40; ++k) {
    const double torque = 3 * std::sin(5 * t), step = k % 3 == 0 ? 0.02 : 0.0311;
    fmu->set(*d.find("torque"), torque);
    truth.set_input("torque", torque);
    ASSERT_TRUE(fmu->step(t, step));
    t += step;
    ASSERT_TRUE(truth.step_to(t).ok());
    for (const char* name : {"hinge.angle", "hinge.angular_speed", "hinge.force.y", "bob.acceleration.x"})
      ASSERT_EQ(fmu->get(*d.find(name)), truth.value(name)) << name << " at " << t;
  }
  EXPECT_EQ(d.find("time") != nullptr, GetParam() == 3);
  if (GetParam() == 3) {
    EXPECT_EQ(fmu->get(*d.find("time")), t);
  }
}

TEST_P(ExportedFmu, GoesBackAlsoInAnotherInstance) {
  const std::string path = pendulum();
  const auto fmu = load_file(path), other = load_file(path);
  const ForeignVariable angle = *fmu->description().find("hinge.angle"), torque = *fmu->description().find("torque");
  fmu->begin(0, {{*fmu->description().find("parameters.mass"), 3.0}});
  const std::string unborn = fmu->save();
  fmu->end_initialization();
  fmu->set(torque, 2);
  ASSERT_TRUE(fmu->step(0, 0.1));
  const std::string state = fmu->save();
  ASSERT_TRUE(fmu->step(0.1, 0.1));
  const double there = fmu->get(angle);
  fmu->restore(state);
  fmu->set(torque, -2);
  ASSERT_TRUE(fmu->step(0.1, 0.05));
  EXPECT_NE(fmu->get(angle), there);
  fmu->restore(state);
  ASSERT_TRUE(fmu->step(0.1, 0.1));
  EXPECT_EQ(fmu->get(angle), there);
  other->begin(0, {});  // with another mass, and no step yet
  other->restore(state);
  ASSERT_TRUE(other->step(0.1, 0.1));
  EXPECT_EQ(other->get(angle), there);
  other->restore(unborn);
  other->end_initialization();
  other->set(torque, 2);
  ASSERT_TRUE(other->step(0, 0.1));
  EXPECT_EQ(other->save().size(), state.size());  // Newton's iteration begins anew there, as above
  ASSERT_TRUE(other->step(0.1, 0.1));
  EXPECT_EQ(other->get(angle), there);
  EXPECT_THROW(other->restore(state.substr(0, state.size() / 2)), Error);
  EXPECT_THROW(other->restore("nonsense"), Error);
}

TEST_P(ExportedFmu, InstancesInThreadsAreApart) {
  const std::string path = pendulum();
  const auto run = [&](double mass, double& out) {
    const auto fmu = load_file(path);
    fmu->begin(0, {{*fmu->description().find("parameters.mass"), mass}});
    fmu->end_initialization();
    for (int k = 0; k < 10; ++k) EXPECT_TRUE(fmu->step(0.05 * k, 0.05));
    out = fmu->get(*fmu->description().find("hinge.force.y"));
  };
  double alone[3], together[3];
  for (int k = 0; k < 3; ++k) run(1 + k, alone[k]);
  std::vector<std::thread> threads;
  for (int k = 0; k < 3; ++k) threads.emplace_back([&, k] { run(1 + k, together[k]); });
  for (std::thread& t : threads) t.join();
  for (int k = 0; k < 3; ++k) EXPECT_EQ(alone[k], together[k]);
  EXPECT_NE(alone[0], alone[1]);
}

TEST_P(ExportedFmu, SaysWhatIsWrongThroughTheLogger) {
  const auto fmu = load_file(pendulum());
  const ModelDescription& d = fmu->description();
  const auto message = [](const auto& call) -> std::string {
    try {
      call();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  fmu->begin(0, {});
  EXPECT_NE(message([&] { (void)fmu->step(0, 0.1); }).find("after the initialization"), std::string::npos);
  fmu->end_initialization();
  EXPECT_NE(message([&] { (void)fmu->step(0.3, 0.1); }).find("the FMU is at 0"), std::string::npos);
  EXPECT_NE(message([&] { (void)fmu->step(0, -0.1); }).find("cannot be made"), std::string::npos);
  EXPECT_NE(message([&] { fmu->set(*d.find("parameters.mass"), 1); }).find("is fixed"), std::string::npos);
  EXPECT_NE(message([&] { fmu->set(*d.find("hinge.angle"), 1); }).find("cannot be set"), std::string::npos);
  EXPECT_NE(message([&] { fmu->set(*d.find("torque"), NAN); }).find("no number"), std::string::npos);
  ForeignVariable none = *d.find("torque");
  none.reference = 1000;
  EXPECT_NE(message([&] { (void)fmu->get(none); }).find("there is no variable 1000"), std::string::npos);
  EXPECT_NE(message([&] {
              fmu->begin(0, {{*d.find("parameters.mass"), -1.0}});
              fmu->end_initialization();
            }).find("mass"),
            std::string::npos);
}

TEST_P(ExportedFmu, HoldsItsFiles) {
  write_file(folder_ / "way.csv", "t,x\n0,0\n1,1\n2,4\n");
  std::string text = kPendulum;
  text.replace(text.find("\"inputs.torque\""), 15, "\"inputs.torque + way(t)\"");
  text += "[splines.way]\nfile = \"way.csv\"\n";
  FmuOptions options = with_library(GetParam());
  const FmuResult r = export_fmu_of_text(text, folder_ / "model.toml", folder_ / "model.fmu", options);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_EQ(r.files, std::vector<std::string>{folder_ / "way.csv"});
  Simulation truth;
  ASSERT_TRUE(truth.load_text(text, folder_ / "model.toml").ok());
  ASSERT_TRUE(truth.step_to(0.5).ok());
  std::filesystem::remove(folder_ / "way.csv");
  const auto fmu = load_file(r.path);
  fmu->begin(0, {});
  fmu->end_initialization();
  ASSERT_TRUE(fmu->step(0, 0.5));
  EXPECT_EQ(fmu->get(*fmu->description().find("hinge.angle")), truth.value("hinge.angle"));
}

TEST_P(ExportedFmu, RunsWithinOurOwnModel) {
  const std::string path = pendulum();
  Simulation s;
  const Status status = s.load_text(R"(
[bodies.m]
type = "point"
mass = 1
[controllers.swing]
type = "fmu"
file = "model.fmu"
step = 0.005
outputs = { angle = "hinge.angle" }
[integrator]
end = 0.5
method = "generalized-alpha"
step = 0.005
)",
                                    folder_ / "outer.toml");
  ASSERT_TRUE(status.ok()) << status.message;
  ASSERT_TRUE(s.run().ok());
  Simulation truth;
  ASSERT_TRUE(truth.load_text(kPendulum, "model.toml").ok());
  ASSERT_TRUE(truth.step_to(0.495).ok());
  EXPECT_NEAR(s.value("swing.angle"), truth.value("hinge.angle"), 1e-12);
}

// Files that simulate takes as they are: a robot, and a deck with a motion.
TEST_P(ExportedFmu, TakesRobotsAndDecks) {
  FmuOptions o = with_library(GetParam());
  write_file(folder_ / "arm.urdf",
             R"(<robot name="arm"><link name="base"/><link name="up"><inertial><origin xyz="0 0 0.3"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="swing" type="continuous">
<parent link="base"/><child link="up"/><axis xyz="0 1 0"/></joint></robot>)");
  o.outputs = {"swing.angle"};
  const FmuResult robot = export_fmu(folder_ / "arm.urdf", folder_ / "arm", o);
  EXPECT_TRUE(robot.status.ok()) << robot.status.message;
  const std::string cube =
      "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n"
      "*ELEMENT, TYPE=C3D8, ELSET=E\n1,1,2,3,4,5,6,7,8\n*MATERIAL, NAME=M\n*ELASTIC\n1000.,0.\n*DENSITY\n2.\n"
      "*SOLID SECTION, ELSET=E, MATERIAL=M\n*BOUNDARY\n1,1,3\n4,1,3\n5,1,3\n8,1,3\n*STEP\n";
  o.outputs = {"part.position"};
  write_file(folder_ / "cube.inp", cube + "*DYNAMIC, DIRECT\n0.01,0.1\n*CLOAD\n2,3,1.\n*END STEP\n");
  const FmuResult deck = export_fmu(folder_ / "cube.inp", folder_ / "cube", o);
  EXPECT_TRUE(deck.status.ok()) << deck.status.message;
  EXPECT_EQ(deck.files, std::vector<std::string>{folder_ / "cube.inp"});
  write_file(folder_ / "cube.inp", cube + "*STATIC\n*CLOAD\n2,3,1.\n*END STEP\n");
  EXPECT_NE(export_fmu(folder_ / "cube.inp", folder_ / "cube", o).status.message.find("needs [integrator]"),
            std::string::npos);
}

TEST_P(ExportedFmu, RefusesWhatIsNoModelOrVariable) {
  FmuOptions o = with_library(GetParam());
  const std::string text = kPendulum;
  o.inputs = {"torqe"};
  EXPECT_NE(refused(text, o).find("did you mean 'torque'?"), std::string::npos);
  o.inputs = {};
  o.parameters = {"masss"};
  EXPECT_NE(refused(text, o).find("did you mean 'mass'?"), std::string::npos);
  o.parameters = {"bodies.bob.inertias.0"};
  EXPECT_NE(refused(text, o), "");
  o.parameters = {"inputs.torque"};
  EXPECT_NE(refused(text, o).find("is no parameter"), std::string::npos);
  o.parameters = {"mass", "parameters.mass"};
  EXPECT_NE(refused(text, o).find("twice"), std::string::npos);
  o.parameters = {};
  o.outputs = {"hinge.angel"};
  EXPECT_NE(refused(text, o).find("did you mean 'angle'?"), std::string::npos);
  o.outputs = {};
  EXPECT_NE(refused(text.substr(0, text.find("[output]")), o).find("without outputs"), std::string::npos);
  std::string still = text;
  still.replace(still.find("[integrator]"), std::string::npos, "[statics]\n");
  EXPECT_NE(refused(still, o).find("needs [integrator]"), std::string::npos);
  o.version = 1;
  EXPECT_NE(refused(text, o).find("versions 2 and 3"), std::string::npos);
  o.version = 3;
  o.library = "/nowhere/espalier_fmu.so";
  EXPECT_NE(refused(text, o).find("no such library"), std::string::npos);
  o.library = TEST_LAG_LIBRARY;
  EXPECT_NE(refused(text, o).find("the licences of the library of FMUs are not there"), std::string::npos);
  o.library = TEST_FMU_LIBRARY;
  EXPECT_NE(refused(text + "[solver]\ndevice = \"gpu:0\"\n", o).find("an FMU computes on the host"), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(Export, ExportedFmu, ::testing::Values(2, 3));

TEST(ExportedLibrary, ShowsTheFunctionsOfTheStandardsAlone) {
  void* library = ::dlopen(TEST_FMU_LIBRARY, RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(library, nullptr) << ::dlerror();
  for (const char* name : {"fmi2DoStep", "fmi2SetRealInputDerivatives", "fmi3DoStep", "fmi3GetDirectionalDerivative"})
    EXPECT_NE(::dlsym(library, name), nullptr) << name;
  for (const char* name : {"_ZN8espalier10SimulationD1Ev", "espalier_version"})
    EXPECT_EQ(::dlsym(library, name), nullptr) << name;
  ::dlclose(library);
}

}  // namespace
}  // namespace espalier::fmi
