// The words of a model: what may stand where a frame is asked for, nodes by label, and what materials need.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

void expect_refusals(const std::vector<Mistake>& mistakes, const std::string& file = "model.toml") {
  for (const Mistake& mistake : mistakes) {
    Simulation s;
    const Status status = s.load_text(mistake.text, file);
    EXPECT_EQ(status.code, StatusCode::invalid_input) << mistake.name;
    for (const std::string& word : mistake.says)
      EXPECT_NE(status.message.find(word), std::string::npos) << mistake.name << ": " << status.message;
  }
}

std::string swinging_bob(const std::string& a, const std::string& b, const std::string& more = "") {
  std::string text = replaced(kPendulum, "bodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]",
                              fmt::format("a = {}\nb = {}", a, b));
  return text + "[output]\nquantities = [\"bob.position.x\", \"hinge.force.x\"]\n" + more;
}

std::vector<double> final_values(const Simulation& s) {
  std::vector<double> values;
  for (const auto& entry : s.summary().values) values.push_back(entry.second);
  return values;
}

const std::string kArm = "{ body = \"bob\", point = [-1, 0, 0], axis = [0, 0, 1] }";

TEST(ModelWords, NamesOfBodiesAreFrames) {
  const std::string markers = "[markers]\norigin = { same_as = \"ground\" }\nmiddle = { same_as = \"bob\" }\n";
  const std::vector<double> truth = final_values(simulated(swinging_bob("{ body = \"ground\" }", kArm)));
  ASSERT_EQ(truth.size(), 2U);
  EXPECT_EQ(final_values(simulated(swinging_bob("\"ground\"", kArm))), truth);
  EXPECT_EQ(final_values(simulated(swinging_bob("\"origin\"", kArm, markers))), truth);
  // The hinge carries the frame on the ground where the centre of mass is.
  const std::string at_rest =
      swinging_bob("{ body = \"ground\", point = [1, 0, 0], axis = [0, 0, 1] }", "\"bob\"", markers);
  const Simulation held = simulated(at_rest);
  EXPECT_NEAR(held.summary().values[0].second, 1, 1e-12);
  EXPECT_EQ(final_values(simulated(replaced(at_rest, "b = \"bob\"", "b = \"middle\""))), final_values(held));
}

TEST(ModelWords, PointMassesAreFrames) {
  const std::string rope = R"(gravity = [0, 0, -10]
[bodies.bob]
type = "point"
mass = 1
position = [1, 0, 0]
[joints.rope]
type = "distance"
a = "ground"
b = "bob"
[integrator]
end = 0.1
[output]
quantities = ["rope.coordinate", "rope.b.position.x", "bob.position.x"]
)";
  const Simulation s = simulated(rope);
  EXPECT_NEAR(s.summary().values[0].second, 1, 1e-9);
  EXPECT_EQ(s.summary().values[1].second, s.summary().values[2].second);
}

TEST(ModelWords, FramesOfJointsAreMarkers) {
  const std::string tip = "{ body = \"bob\", point = [0.5, 0, 0], name = \"tip\" }";
  const std::string text = swinging_bob("\"ground\"", kArm) + R"([forces.pull]
type = "load"
a = )" + tip + R"(
force = ["-0.1*tip.velocity.x - 0.2*pull.a.velocity.y", 0, 0]
[forces.cord]
type = "spring"
a = "hinge.a"
b = "tip"
stiffness = 3
rest = 1.2
)";
  Simulation s = simulated(text);
  for (const char* axis : {"x", "y", "z"}) {
    EXPECT_EQ(s.value(fmt::format("hinge.a.position.{}", axis)), 0);
    EXPECT_NEAR(s.value(fmt::format("hinge.b.position.{}", axis)), 0, 1e-9);
    EXPECT_EQ(s.value(fmt::format("tip.position.{}", axis)), s.value(fmt::format("pull.a.position.{}", axis)));
    EXPECT_EQ(s.value(fmt::format("tip.acceleration.{}", axis)), s.value(fmt::format("cord.b.acceleration.{}", axis)));
  }
  // A rigid bob: its end is half as far out again.
  EXPECT_NEAR(s.value("tip.position.y"), 1.5 * s.value("bob.position.y"), 1e-12);
  EXPECT_NEAR(s.value("cord.coordinate"), std::hypot(s.value("tip.position.x"), s.value("tip.position.y")), 1e-12);
  // The same with a marker of its own.
  const std::string named =
      replaced(text, tip, "\"tip\"") + "[markers]\ntip = { body = \"bob\", point = [0.5, 0, 0] }\n";
  EXPECT_EQ(simulated(named).value("tip.position.x"), s.value("tip.position.x"));
}

TEST(ModelWords, WhatIsNoFrameIsRefused) {
  const std::string flexible =
      "[bodies.arm]\ntype = \"solid\"\nmesh = { part = \"block\", divisions = [1, 1, 1] }\n"
      "material = { young = 1e9, density = 1000 }\n";
  expect_refusals({
      {"unknown", swinging_bob("\"grund\"", kArm), {"joints.hinge.a", "did you mean 'ground'"}},
      {"near", swinging_bob("\"bop\"", kArm), {"unknown marker 'bop'", "did you mean 'bob'"}},
      {"flexible", swinging_bob("\"ground\"", "\"arm\"", flexible), {"joints.hinge.b", "'arm' is flexible: say where"}},
      {"letter", swinging_bob("\"ground\"", "\"hinge.c\""), {"unknown marker 'hinge.c'", "hinge.a"}},
      {"circle", swinging_bob("\"hinge.b\"", "\"hinge.a\""), {"circle"}},
      {"list", swinging_bob("[0, 0, 0]", kArm), {"joints.hinge.a", "must be a frame", "a list"}},
      {"number", swinging_bob("3", kArm), {"must be a frame", "a whole number"}},
      {"taken", swinging_bob("{ body = \"ground\", name = \"bob\" }", kArm), {"'bob' is taken"}},
      {"twice",
       swinging_bob("{ body = \"ground\", name = \"x\" }", "{ body = \"bob\", name = \"x\" }"),
       {"'x' is taken"}},
      {"signs", swinging_bob("{ body = \"ground\", name = \"x.y\" }", kArm), {"letters, digits"}},
      {"quantity", swinging_bob("\"ground\"", kArm) + "[sensors]\nx = \"hinge.d.position.x\"\n", {"hinge"}},
      {"axis",
       replaced(swinging_bob("\"ground\"", "\"bob\""), "\na = ", "\naxis = [0, 0, 1]\na = "),
       {"joints.hinge.axis", "axis = [..] }"}},
      {"no section", "output = 3\n" + kPendulum, {"output", "must be a section, [output]"}},
      {"no table",
       swinging_bob("\"ground\"", kArm, "envelopes = []\npaths = { x = 3 }\n"),
       {"output.paths.x", "table"}},
      {"sections", "forces = [1]\n" + kPendulum, {"forces", "named tables", "[forces.name]"}},
      {"joints", "joints = 3\n" + kPendulum.substr(0, kPendulum.find("[joints")), {"joints", "named tables"}},
      {"lists", replaced(kPendulum, "[joints.hinge]", "[[joints]]"), {"joints", "named tables", "[joints.name]"}},
  });
}

/// Two hexahedra in a row along x; nodes have the labels 10, 20, ..., 120, four for each x.
std::string text_of_two() {
  std::string text = "*NODE\n";
  int label = 10;
  for (int x = 0; x < 3; ++x)
    for (const auto& [y, z] : {std::pair{0, 0}, std::pair{1, 0}, std::pair{1, 1}, std::pair{0, 1}}) {
      text += fmt::format("{}, {}, {}, {}\n", label, 0.1 * x, 0.1 * y, 0.1 * z);
      label += 10;
    }
  return text + R"(*ELEMENT, TYPE=C3D8, ELSET=ALL
1, 10, 20, 30, 40, 50, 60, 70, 80
2, 50, 60, 70, 80, 90, 100, 110, 120
*NSET, NSET=WALL
10, 20, 30, 40
*NSET, NSET=TIP
90, 100, 110, 120
*NSET, NSET=RIM
50, 60, 90, 110
*MATERIAL, NAME=STEEL
*ELASTIC
2e11, 0.3
*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL
)";
}

class MeshOfTwo : public testing::Test {
 protected:
  MeshOfTwo() { std::ofstream(folder_.path() + "/two.inp") << text_of_two(); }
  [[nodiscard]] std::string file() const { return folder_.path() + "/model.toml"; }
  [[nodiscard]] static std::string bar(const std::string& more) {
    return "[bodies.bar]\ntype = \"solid\"\nmesh = { file = \"two.inp\" }\n" + more;
  }
  [[nodiscard]] std::vector<double> solved(const std::string& text) const {
    Simulation s;
    Status status = s.load_text(text, file());
    if (status.ok()) status = s.run();
    EXPECT_TRUE(status.ok()) << status.message;
    return final_values(s);
  }

 private:
  ScratchFolder folder_;
};

TEST_F(MeshOfTwo, NodesHaveTheLabelsOfTheFile) {
  const std::string by_name = bar(R"([supports.wall]
body = "bar"
nodes = "WALL"
hold = "all"
[forces.pull]
type = "load"
a = { body = "bar", nodes = "TIP" }
force = [0, 1e4, 0]
[statics]
linear = true
[output]
quantities = ["wall.force", "bar[node 100].reaction.y", "pull.a.position"]
)");
  const std::vector<double> truth = solved(by_name);
  ASSERT_EQ(truth.size(), 7U);
  EXPECT_NEAR(truth[1], -1e4, 1e-6);
  EXPECT_EQ(solved(replaced(replaced(by_name, "\"WALL\"", "[40, 10, 30, 20]"), "\"TIP\"", "[90, 120, 110, 100, 90]")),
            truth);
  // The face set that the node set makes holds the same nodes.
  EXPECT_EQ(solved(replaced(by_name, "nodes = \"WALL\"", "face = \"WALL\"")), truth);
  // Without gravity neither path needs a density, and a heavier bar hangs no lower.
  const std::string heavy = R"(material = { young = 2e11, poisson = 0.3, density = 7850 }
[supports.wall])";
  EXPECT_EQ(solved(replaced(by_name, "[supports.wall]", heavy)), truth);
  const std::string path = replaced(by_name, "linear = true", "load = 1");
  const std::vector<double> light = solved(path), weighty = solved(replaced(path, "[supports.wall]", heavy));
  for (std::size_t k = 0; k < 7; ++k) EXPECT_NEAR(light[k], weighty[k], 1e-6 * std::abs(weighty[k]) + 1e-6);
}

// A file without labels: its points count from 1, and those that no element uses count, too.
TEST_F(MeshOfTwo, PointsOfVtkCountFromOne) {
  std::ofstream(std::filesystem::path(file()).parent_path() / "tet.vtk")
      << "# vtk DataFile Version 3.0\ntet\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 double\n0 0 0\n9 9 9\n1 0 0\n0 1 "
         "0\n"
         "0 0 1\nCELLS 1 5\n4 0 2 3 4\nCELL_TYPES 1\n10\n";
  const std::string text = R"([bodies.tet]
type = "solid"
mesh = { file = "tet.vtk" }
material = { young = 1e9, poisson = 0.3 }
[supports.wall]
body = "tet"
nodes = [1, 3, 4]
hold = "all"
[forces.up]
type = "load"
a = { body = "tet", node = 5 }
force = [0, 0, 1]
[statics]
linear = true
[output]
quantities = ["wall.force.z", "up.a.position.z"]
)";
  const std::vector<double> found = solved(text);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NEAR(found[0], -1, 1e-9);
  EXPECT_NEAR(found[1], 1, 1e-6);
  expect_refusals({{"unused", replaced(text, "[1, 3, 4]", "[1, 2]"), {"has no node 2", "4 nodes", "1 to 5"}},
                   {"zero", replaced(text, "[1, 3, 4]", "[0, 1]"), {"has no node 0", "1, 3, 4, 5"}}},
                  file());
}

TEST_F(MeshOfTwo, NodeSetsTurnWhereJointsNeedAxes) {
  const std::string hinged = bar(R"([joints.hinge]
type = "revolute"
a = { body = "ground", axis = [0, 0, 1] }
b = { body = "bar", nodes = "RIM" }
[supports.guide]
body = "bar"
nodes = "TIP"
hold = "xz"
[forces.twist]
type = "load"
a = { body = "bar", nodes = [50, 60, 70, 80] }
moment = [0, 0, 100]
[statics]
linear = true
[output]
quantities = ["hinge.force.norm", "guide.moment.z"]
)");
  const std::vector<double> balance =
      solved(replaced(hinged, "\"hinge.force.norm\"", "\"hinge.force\", \"guide.force\""));
  ASSERT_EQ(balance.size(), 7U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(balance[i], -balance[i + 3], 1e-6);
  EXPECT_EQ(solved(hinged), solved(replaced(hinged, "nodes = \"RIM\"", "nodes = \"RIM\", attach = \"mean\"")));
}

TEST_F(MeshOfTwo, WhatIsMissingIsNamed) {
  const std::string run = "[integrator]\nend = 1\n", still = "[statics]\n";
  const auto support = [](const std::string& nodes) {
    return "[supports.wall]\nbody = \"bar\"\nhold = \"all\"\n" + nodes + "\n";
  };
  const std::string steel = "material = { young = 2e11, density = 7850 }\n";
  expect_refusals(
      {
          {"label",
           bar(support("nodes = [10, 31]")) + still,
           {"has no node 31", "12 nodes", "10 to 120", "20, 30, 40, 50"}},
          {"first", bar(support("nodes = [1]")) + still, {"has no node 1:", "10, 20, 30, 40"}},
          {"last", bar(support("node = 500")) + still, {"has no node 500", "90, 100, 110, 120"}},
          {"asked",
           bar(support("node = 10")) + still + "[output]\nquantities = [\"bar[node 11].reaction.x\"]\n",
           {"has no node 11", "10, 20"}},
          {"none", bar(support("nodes = []")) + still, {"nodes", "list of labels"}},
          {"names", bar(support("nodes = [\"WALL\"]")) + still, {"nodes", "one node set"}},
          {"half", bar(support("nodes = [10.5]")) + still, {"whole numbers", "10.5"}},
          {"one", bar(support("nodes = 10")) + still, {"node = 31"}},
          {"face", bar(support("face = \"RIM\"")) + still, {"'RIM' is a set of nodes", "nodes = \"RIM\""}},
          {"pressure",
           bar(support("face = \"WALL\"")) +
               "[forces.p]\ntype = \"pressure\"\nbody = \"bar\"\nface = \"RIM\"\npressure = 1\n" + still,
           {"'RIM'", "pressure needs faces", "type = \"load\"", "nodes = \"RIM\""}},
          {"file without density", bar("") + run, {"material", "states 'STEEL' without a density"}},
          {"gravity", bar("gravity = [0, 0, -10]\n") + still, {"needs a density"}},
          {"modes", bar(support("node = 10")) + still + "[initial]\nmodes = 2\n", {"density"}},
          {"both", bar("material = { poisson = 0.3 }\n") + run, {"bodies.bar.material", "'young'", "and 'density'"}},
          {"young", bar("material = { density = 7850 }\n") + run, {"needs 'young'"}},
          {"density", bar("material = { young = 2e11 }\n") + run, {"needs 'density'", "statics"}},
          {"named",
           bar("material = \"steel\"\n") + "[materials.steel]\nyoung = 2e11\n" + run,
           {"materials.steel", "needs 'density'"}},
          {"misspelt", bar("material = { yung = 2e11, density = 1 }\n") + run, {"yung", "did you mean 'young'"}},
          {"no material",
           "[bodies.b]\ntype = \"solid\"\nmesh = { part = \"block\", divisions = [1, 1, 1] }\n" + run,
           {"needs 'material'", "[materials]"}},
      },
      file());
}

}  // namespace
}  // namespace espalier::dynamics
