// What decks of Abaqus and CalculiX have beside solids: other elements, capitals, generated nodes and elements,
// systems.
#include <numbers>

#include "dynamics/mesh/mesh_files.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace mesh_abaqus_test {

using test::mesh_volume;
using test::MeshFiles;
using MeshAbaqus = MeshFiles;

/// A unit cube of one C3D8, then `more`.
std::string cube(const std::string& more) {
  return "*HEADING\na cube\n*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n"
         "21,2,0,0\n22,3,0,0\n23,3,1,0\n24,2,1,0\n25,2,0,1\n26,3,0,1\n27,3,1,1\n28,2,1,1\n"
         "*ELEMENT, TYPE=C3D8, ELSET=EALL\n1,1,2,3,4,5,6,7,8\n" +
         more + "*MATERIAL, NAME=Steel\n*ELASTIC\n1e6, 0.3\n*DENSITY\n2.\n*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL\n";
}

/// A body of the deck at rest in free space. @param chosen  an element_set, or ""
std::unique_ptr<model::Mechanism> body_of(const std::string& path, const std::string& chosen) {
  return built("[bodies.part]\ntype = \"solid\"\nmesh = { file = \"" + path + "\" }\n" +
               (chosen.empty() ? "" : "element_set = \"" + chosen + "\"\n") + "[integrator]\nend = 1\n");
}

struct Kind {
  const char* type;
  int nodes;
};
constexpr Kind kKinds[] = {{"MASS", 1},     {"ROTARYI", 1},  {"SPRING1", 1},  {"SPRING2", 2}, {"SPRINGA", 2},
                           {"DASHPOT1", 1}, {"DASHPOT2", 2}, {"DASHPOTA", 2}, {"CONN3D2", 2}, {"GAPUNI", 2},
                           {"R3D3", 3},     {"R3D4", 4},     {"DCOUP3D", 1},  {"COH3D8", 8},  {"AC3D8", 8},
                           {"DC3D8", 8},    {"GASK3D8", 8},  {"U17", 5},      {"B31", 2},     {"B33", 2},
                           {"B31OS", 2},    {"T3D2", 2},     {"M3D4", 4},     {"M3D4R", 4},   {"SFM3D4", 4},
                           {"S3", 3},       {"S4", 4},       {"S4R5", 4},     {"S8R5", 8},    {"CPS4", 4}};

// Truth: the cube's mass 2 and volume 1, whatever stands beside it, on its nodes or on others, with a set and without.
TEST_F(MeshAbaqus, OtherElementsArePassedOver) {
  for (const Kind& kind : kKinds)
    for (const int first : {1, 21})
      for (const std::string chosen : {"", "EALL", "MIXED", "eall"}) {
        std::string element = "*ELEMENT, TYPE=" + std::string(kind.type) + ", ELSET=OTHER\n9";
        for (int n = 0; n < kind.nodes; ++n) element += "," + std::to_string(first + n);
        const std::string path = write("beside.inp", cube(element + "\n*ELSET, ELSET=MIXED\n1, 9\n"));
        const auto mechanism = body_of(path, chosen);
        const auto& body = mechanism->bodies.at(0);
        EXPECT_NEAR(mesh_volume(*body.mesh), 1, 1e-14) << kind.type;
        EXPECT_EQ(body.flexible->reference().size(), 24U) << kind.type << " " << first << " '" << chosen << "'";
        EXPECT_EQ(body.material.density, 2) << kind.type;
        std::string said;
        for (const std::string& notice : body.notices) said += notice + "\n";
        const bool kept = read_mesh(path).element_count() == 2;  // surfaces and lines, by their shapes
        if (!kept) {
          EXPECT_NE(said.find(std::string(kind.type) + " (1)"), std::string::npos) << said;
        }
        if (kept && (chosen.empty() || chosen == "MIXED")) {
          EXPECT_NE(said.find(first == 1 ? "serve as sets only" : "elements that are no solids are passed over: 1 "),
                    std::string::npos)
              << kind.type << ": " << said;
        }
      }
}

// A solid that is not known would be missing.
TEST_F(MeshAbaqus, UnknownSolidsAreRefused) {
  for (const char* type : {"C3D27", "C3D13", "C3D15V"})
    expect_error(write("unknown.inp", cube("*ELEMENT, TYPE=" + std::string(type) + "\n9,1,2,3\n")), 22,
                 "element type " + std::string(type));
  const Mesh shells = read_mesh(write("sc8r.inp", cube("*ELEMENT, TYPE=SC8R\n9,21,22,23,24,25,26,27,28\n*ELEMENT, "
                                                       "TYPE=SC6R\n10,21,22,23,25,26,27\n")));
  EXPECT_EQ(shells.type(1), ElementType::hex8);
  EXPECT_EQ(shells.type(2), ElementType::wedge6);
  ASSERT_EQ(shells.notices.size(), 1U);
  EXPECT_NE(shells.notices[0].find("SC6R (1), SC8R (1)"), std::string::npos) << shells.notices[0];
}

TEST_F(MeshAbaqus, KeywordsThatAreDroppedAreCounted) {
  const Mesh mesh = read_mesh(write(
      "step.inp",
      cube("*BOUNDARY\n1,1,3\n*STEP\n*STATIC\n1.,1.\n*CLOAD\n7,1,5.\n*CLOAD\n8,1,5.\n*EL PRINT\nS\n*END STEP\n")));
  ASSERT_EQ(mesh.notices.size(), 1U);
  for (const char* part : {"*BOUNDARY (1)", "*CLOAD (2)", "*STEP (1)", "*STATIC (1)"})
    EXPECT_NE(mesh.notices[0].find(part), std::string::npos) << mesh.notices[0];
  EXPECT_EQ(mesh.notices[0].find("PRINT"), std::string::npos) << mesh.notices[0];
}

// Truth: the same mesh in small and capital letters.
TEST_F(MeshAbaqus, CapitalsMeanNothing) {
  const std::string deck = "*Nset, Nset=Clamp\n1,2\n*surface, NAME=Top\nEall, s2\n*elset, elset=Both\nEALL\n";
  for (const bool small : {false, true}) {
    std::string text = cube(deck);
    if (small)
      for (char& c : text) c = static_cast<char>(std::tolower(c));
    const std::string path = write("case.inp", text);
    const Mesh mesh = read_mesh(path);
    EXPECT_EQ(mesh.node_set("CLAMP").size(), 2U);
    EXPECT_EQ(mesh.node_set("clamp").size(), 2U);
    EXPECT_EQ(mesh.face_set("tOP").size(), 1U);
    EXPECT_EQ(mesh.element_set("bOTH").size(), 1U);
    EXPECT_EQ(body_of(path, "BOTH")->bodies.at(0).material.density, 2);
    EXPECT_EQ(body_of(path, "eAll")->bodies.at(0).material.density, 2);
  }
  Mesh two;  // names that differ by capitals alone stay two
  two.node_sets = {{"a", {1}}, {"A", {2}}};
  EXPECT_EQ(two.node_set("a"), std::vector<Index>{1});
  EXPECT_EQ(two.node_set("A"), std::vector<Index>{2});
  two.node_sets = {{"ab", {1}}, {"AB", {2}}};
  EXPECT_THROW(static_cast<void>(two.node_set("Ab")), Error);
}

// Truth: a block of 4 x 3 x 2 cubes of edge 1 has the volume 24, 5 x 4 x 3 nodes on whole places, and sets of its
// sides.
TEST_F(MeshAbaqus, GeneratedBlock) {
  const std::string text =
      "*NODE\n1,0,0,0\n5,4,0,0\n31,0,3,0\n35,4,3,0\n"
      "*NGEN, NSET=FRONT\n1,5\n*NGEN, NSET=BACK\n31,35,1\n*NFILL, NSET=BASE\nfront, BACK, 3, 10\n"
      "*NCOPY, CHANGE NUMBER=100, OLD SET=BASE, NEW SET=ABOVE, SHIFT, MULTIPLE=2\n0,0,1\n0,0,0,0,0,1,0\n"
      "*ELEMENT, TYPE=C3D8R\n1, 1,2,12,11,101,102,112,111\n*ELGEN, ELSET=ALL\n1, 4,1,1, 3,10,10, 2,100,100\n";
  const Mesh mesh = read_mesh(write("block.inp", text));
  EXPECT_EQ(mesh.element_count(), 24);
  EXPECT_NEAR(mesh_volume(mesh), 24, 1e-12);
  EXPECT_EQ(mesh.nodes.size(), 60U);
  EXPECT_EQ(mesh.element_set("ALL").size(), 24U);
  EXPECT_EQ(mesh.node_set("BASE").size(), 20U);
  EXPECT_EQ(mesh.node_set("ABOVE").size(), 40U);
  EXPECT_EQ(mesh.boundary_faces().size(), 2U * (12 + 8 + 6));
}

// Truth: closed forms of arcs, parabolas and geometric series.
TEST_F(MeshAbaqus, CurvesAndBias) {
  const std::string element = "*ELEMENT, TYPE=C3D4\n1,1,5,9,90\n";
  const Mesh arc = read_mesh(write("arc.inp",
                                   "*NODE\n1,2,0,0\n5,0,2,0\n9,-2,0,0\n90,0,0,0\n*NGEN, LINE=C\n1,5,1,90\n"
                                   "5,9,1,,0,0,0,0,0,-1\n" +
                                       element));
  const auto at = [](const Mesh& mesh, std::int64_t label) {
    for (std::size_t k = mesh.nodes.size(); k-- > 0;)
      if (mesh.node_labels[k] == label) return mesh.nodes[k];
    return Point{std::nan(""), 0, 0};
  };
  const double q = std::numbers::pi / 4;
  EXPECT_NEAR(at(arc, 3)[0], 2 * std::cos(q), 1e-14);
  EXPECT_NEAR(at(arc, 3)[1], 2 * std::sin(q), 1e-14);
  // From (0, 2) to (-2, 0) the other way round: 270 degrees about -z, through (2, 0) after 90 of them.
  EXPECT_NEAR(at(arc, 7)[0], 2 * std::cos(-q), 1e-14);
  EXPECT_NEAR(at(arc, 7)[1], 2 * std::sin(-q), 1e-14);
  const Mesh biased = read_mesh(
      write("bias.inp",
            "*NODE, NSET=A\n1,0,0,0\n*NODE, NSET=B\n4,7,0,0\n*NODE\n9,0,1,0\n90,0,0,1\n*NFILL, BIAS=0.5\nA,B,3,1\n"
            "*ELEMENT, TYPE=C3D4\n1,1,4,9,90\n"));
  EXPECT_NEAR(at(biased, 2)[0], 1, 1e-14);  // 1 + 2 + 4
  EXPECT_NEAR(at(biased, 3)[0], 3, 1e-14);
}

TEST_F(MeshAbaqus, Parabola) {
  const Mesh mesh = read_mesh(write(
      "p.inp", "*NODE\n1,0,0,0\n5,4,0,0\n8,2,3,0\n9,0,0,1\n*NGEN, LINE=P\n1,5,1,8\n*ELEMENT, TYPE=C3D4\n1,1,5,8,9\n"));
  // y = 3 (1 - (x - 2)^2 / 4)
  EXPECT_NEAR(mesh.nodes[4][0], 1, 1e-14);
  EXPECT_NEAR(mesh.nodes[4][1], 2.25, 1e-14);
}

// Truth: cylindrical and spherical coordinates, a turned system, copies turned and mirrored.
TEST_F(MeshAbaqus, SystemsAndCopies) {
  const Mesh mesh = read_mesh(
      write("s.inp",
            "*NODE, SYSTEM=C\n1, 2., 90., 5.\n*NODE, SYSTEM=S\n2, 2., 90., 30.\n*SYSTEM\n10,0,0, "
            "10,1,0\n9,0,0\n*NODE\n3, 1,2,3\n"
            "*NODE, SYSTEM=C\n4, 1., 90., 0.\n*SYSTEM\n1,1,1\n*NODE\n5, 1,0,0\n*SYSTEM\n*NODE, NSET=ONE\n6, 1,0,0\n"
            "*NCOPY, CHANGE NUMBER=10, OLD SET=ONE, SHIFT\n0,0,2\n0,0,0, 0,0,1, 90\n"
            "*NCOPY, CHANGE NUMBER=20, OLD SET=ONE, REFLECT=POINT\n0,1,0\n"
            "*NCOPY, CHANGE NUMBER=30, OLD SET=ONE, REFLECT=MIRROR\n3,0,0, 3,1,0\n3,0,1\n"
            "*NCOPY, CHANGE NUMBER=40, OLD SET=ONE, REFLECT=LINE\n0,0,0, 0,1,0\n*ELEMENT, TYPE=C3D4\n1,1,2,3,4\n"));
  const Point right[] = {
      {0, 2, 5}, {0, std::sqrt(3.0), 1}, {8, 1, 3}, {9, 0, 0}, {2, 1, 1}, {1, 0, 0}, {0, 1, 2}, {-1, 2, 0}, {5, 0, 0},
      {-1, 0, 0}};
  ASSERT_EQ(mesh.nodes.size(), std::size(right));
  for (std::size_t n = 0; n < std::size(right); ++n)
    for (std::size_t d = 0; d < 3; ++d) EXPECT_NEAR(mesh.nodes[n][d], right[n][d], 1e-14) << n << " " << d;
}

// Truth: p - 2 (p - a) n n for the plane x + y + z = 1, and half a turn about a line along z through (1, 0).
TEST_F(MeshAbaqus, MirrorsAwayFromTheOrigin) {
  const Mesh mesh = read_mesh(
      write("m.inp",
            "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n*NODE, NSET=ONE\n4, 2,0,3\n"
            "*NCOPY, CHANGE NUMBER=10, OLD SET=ONE, REFLECT=MIRROR\n0,0,1, 0,1,0\n1,0,0\n"
            "*NCOPY, CHANGE NUMBER=20, OLD SET=ONE, REFLECT=LINE\n1,0,2, 1,0,5\n*ELEMENT, TYPE=C3D4\n1,1,2,3,4\n"));
  ASSERT_EQ(mesh.nodes.size(), 6U);
  const Point mirrored = {-2.0 / 3, -8.0 / 3, 1.0 / 3}, turned = {0, 0, 3};
  for (std::size_t d = 0; d < 3; ++d) {
    EXPECT_NEAR(mesh.nodes[4][d], mirrored[d], 1e-14) << d;
    EXPECT_NEAR(mesh.nodes[5][d], turned[d], 1e-14) << d;
  }
}

// Truth: a cube and its copies, one and two higher.
TEST_F(MeshAbaqus, CopiesOfElements) {
  const std::string text =
      "*NODE, NSET=LOW\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n11,0,0,1\n12,1,0,1\n13,1,1,1\n14,0,1,1\n"
      "*NCOPY, CHANGE NUMBER=100, OLD SET=LOW, SHIFT\n0,0,2\n0,0,0,0,0,1,0\n"
      "*ELEMENT, TYPE=C3D8, ELSET=ONE\n7, 1,2,3,4,11,12,13,14\n"
      "*ELCOPY, ELEMENT SHIFT=5, SHIFT NODES=100, OLD SET=ONE, NEW SET=COPY\n";
  const Mesh mesh = read_mesh(write("c.inp", text));
  ASSERT_EQ(mesh.element_count(), 2);
  EXPECT_NEAR(mesh_volume(mesh), 2, 1e-14);
  EXPECT_EQ(mesh.element_set("ONE"), std::vector<Index>{0});
  EXPECT_EQ(mesh.element_set("COPY"), std::vector<Index>{1});
  for (const Index n : mesh.element(1)) EXPECT_GE(mesh.nodes[static_cast<std::size_t>(n)][2], 2);
  expect_error(write("r.inp", replaced(text, "*ELCOPY, ", "*ELCOPY, REFLECT, ")), 15, "*ELCOPY, REFLECT is not read");
}

TEST_F(MeshAbaqus, SetsOfUnequalLengthsAreFilledAsFarAsBothGo) {
  const Mesh mesh =
      read_mesh(write("u.inp",
                      "*NODE, NSET=A\n1,0,0,0\n*NODE, NSET=B\n3,2,0,0\n4,2,5,0\n5,0,0,1\n*NFILL\nA,B,2,1\n"
                      "*ELEMENT, TYPE=C3D4\n1,1,3,4,5\n"));
  ASSERT_EQ(mesh.nodes.size(), 5U);
  EXPECT_EQ(mesh.node_labels[4], 2);
  EXPECT_NEAR(mesh.nodes[4][0], 1, 1e-14);
}

TEST_F(MeshAbaqus, WrongGeneratorsAreNamed) {
  const std::string two = "*NODE\n1,0,0,0\n9,1,0,0\n";
  expect_error(write("a.inp", two + "*NGEN\n1,9,3\n"), 5, "does not lead from node 1 to node 9");
  expect_error(write("b.inp", two + "*NGEN\n1,8\n"), 5, "node 8 is not defined");
  expect_error(write("c.inp", two + "*NGEN, LINE=X\n1,9\n"), 4, "LINE=X");
  expect_error(write("d.inp", two + "*NGEN, LINE=C\n1,9,1,,0.5,0,0\n"), 5, "normal of the arc");
  expect_error(write("e.inp", two + "*ELGEN\n1, 2\n"), 5, "element 1 is not defined");
  expect_error(write("f.inp", two + "*NFILL\nA,B,3\n"), 5, "set A is not defined");
  expect_error(write("g.inp", "*NODE\n1,0,0,0\n100000001,1,0,0\n*NGEN\n1,100000001\n"), 5, "more than 5000000");
  expect_error(write("h.inp", "*SYSTEM\n0,0,0, 0,0,1\n"), 2, "one line");
  expect_error(write("i.inp", "*NODE, SYSTEM=Q\n1, 1,1,1\n"), 2, "SYSTEM=Q");
  expect_error(write("j.inp", "*INCLUDE, INPUT=none.inc\n"), 1, "there is no file");
  expect_error(write("k.inp", two + "*NGEN\n1,9223372036854775807\n"), 5, "no number of a node");
}

// Two instances: whole ones are sets, and messages say which one is meant.
TEST_F(MeshAbaqus, InstancesAreNamed) {
  const std::string path = write(
      "two.inp",
      "*PART, NAME=P\n*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT,TYPE=C3D4,ELSET=E\n1,1,2,3,4\n*END PART\n"
      "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I-1, PART=P\n*END INSTANCE\n*INSTANCE, NAME=I-2, PART=P\n5,0,0\n*END "
      "INSTANCE\n*END ASSEMBLY\n*MATERIAL, NAME=M\n*ELASTIC\n1e6,0.3\n*DENSITY\n1\n*SOLID SECTION, ELSET=E, "
      "MATERIAL=m\n");
  const Mesh mesh = read_mesh(path);
  EXPECT_EQ(mesh.element_set("i-2.*"), std::vector<Index>{1});
  EXPECT_EQ(mesh.node_set("I-1.*"), (std::vector<Index>{0, 1, 2, 3}));
  const auto both = body_of(path, "");
  EXPECT_NE(both->bodies.at(0).pieces.find("I-1.1, I-2.1"), std::string::npos) << both->bodies.at(0).pieces;
  const auto second = body_of(path, "I-2.*");
  EXPECT_EQ(second->bodies.at(0).flexible->reference().size(), 12U);
  EXPECT_GE(*std::min_element(second->bodies.at(0).flexible->reference().begin(),
                              second->bodies.at(0).flexible->reference().end()),
            0);
}

// As Abaqus and CalculiX take them: members that are not defined are left out, and surfaces of edges are none.
TEST_F(MeshAbaqus, MembersThatAreNotDefined) {
  const Mesh mesh =
      read_mesh(write("gaps.inp", cube("*NSET, NSET=GAPS, GENERATE\n7,22\n*ELEMENT, TYPE=CPS4, ELSET=FLAT\n"
                                       "5,1,2,3,4\n*SURFACE, NAME=EDGE\n5, S4\n")));
  EXPECT_EQ(mesh.node_set("GAPS"), (std::vector<Index>{6, 7, 8, 9}));
  EXPECT_FALSE(mesh.face_sets.contains("EDGE"));
  ASSERT_EQ(mesh.notices.size(), 1U);
  EXPECT_NE(mesh.notices[0].find("left out: 12, the first is node 9 in "), std::string::npos) << mesh.notices[0];
  EXPECT_NE(mesh.notices[0].find("gaps.inp:23"), std::string::npos) << mesh.notices[0];
}

// A deck where a model is needed: what to do, not what the other language would have said.
TEST_F(MeshAbaqus, ADeckIsNoModel) {
  const std::string path = write("part.inp", cube(""));
  Simulation s;
  const Status status = s.load(path);
  ASSERT_FALSE(status.ok());
  for (const char* part : {"is a mesh", "espalier mesh ", "--model", "mesh = { file = \"part.inp\" }"})
    EXPECT_NE(status.message.find(part), std::string::npos) << status.message;
}

}  // namespace mesh_abaqus_test
}  // namespace espalier::dynamics
