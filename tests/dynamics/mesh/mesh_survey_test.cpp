// What is said of a mesh. Truth: a cube and a tetrahedron by hand, curved faces by a closed form, faults put in.
#include <cmath>

#include "dynamics/mesh/mesh_files.hpp"
#include "dynamics/mesh/names.hpp"
#include "dynamics/mesh/sides.hpp"
#include "dynamics/mesh/survey.hpp"
#include "dynamics/meshers/parts.hpp"

namespace espalier::dynamics::test {
namespace mesh_survey_test {

Mesh one(ElementType type, std::vector<Point> nodes) {
  Mesh mesh;
  mesh.nodes = std::move(nodes);
  std::vector<Index> all(mesh.nodes.size());
  for (std::size_t k = 0; k < all.size(); ++k) all[k] = static_cast<Index>(k);
  mesh.add_element(type, all);
  return mesh;
}

const std::vector<Point> kUnitCube = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                      {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};

TEST(MeshSurvey, LinearSolids) {
  const MeshSurvey cube = survey_mesh(one(ElementType::hex8, kUnitCube));
  EXPECT_NEAR(cube.volume, 1, 1e-15);
  EXPECT_NEAR(cube.surface, 6, 1e-13);
  EXPECT_NEAR(cube.least_shape, 1, 1e-15);
  EXPECT_EQ(cube.outer_faces, 6);
  EXPECT_TRUE(cube.defects.empty());
  const double h = std::sqrt(2.0 / 3), r = 1 / std::sqrt(3.0);
  const MeshSurvey tet =
      survey_mesh(one(ElementType::tet4, {{0, 0, 0}, {1, 0, 0}, {0.5, 1.5 * r, 0}, {0.5, 0.5 * r, h}}));
  EXPECT_NEAR(tet.volume, std::sqrt(2.0) / 12, 1e-15);
  EXPECT_NEAR(tet.least_shape, std::sqrt(0.5), 1e-14);
  EXPECT_NEAR(tet.centre[2], 0.25 * h, 1e-15);
  const MeshSurvey wedge =
      survey_mesh(one(ElementType::wedge6, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 2}, {1, 0, 2}, {0, 1, 2}}));
  EXPECT_NEAR(wedge.volume, 1, 1e-15);
  EXPECT_NEAR(wedge.centre[0], 1.0 / 3, 1e-15);
  EXPECT_TRUE(wedge.defects.empty());
  const MeshSurvey pyramid =
      survey_mesh(one(ElementType::pyramid5, {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 3}}));
  EXPECT_NEAR(pyramid.volume, 1, 1e-15);
  EXPECT_NEAR(pyramid.centre[2], 0.75, 1e-15);
  EXPECT_EQ(pyramid.defects.size(), 1U);  // is not simulated
}

// Truth: the volume that a hex20 whose top is bent into a parabola gains: the integral of 4 b x (1 - x) is 2 b / 3, its
// first moment in z that of (1 + 4 b x (1 - x))^2 / 2.
TEST(MeshSurvey, CurvedFaces) {
  constexpr MidSideEdges kOwn = {
      {}, {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};
  std::vector<Point> nodes = second_order_nodes(false, kOwn);
  for (Point& p : nodes)
    for (double& x : p) x *= 0.5;
  const double b = 0.3;
  nodes[12][2] += b;  // 45 and 67, along x at z = 1
  nodes[14][2] += b;
  const Mesh mesh = one(ElementType::hex20, nodes);
  const MeshSurvey s = survey_mesh(mesh);
  EXPECT_NEAR(s.volume, 1 + 2 * b / 3, 1e-14);
  EXPECT_NEAR(s.volume, mesh_volume(mesh), 1e-14);
  EXPECT_NEAR(s.centre[2] * s.volume, 0.5 * (1 + 4 * b / 3 + 16 * b * b / 30), 1e-14);
  EXPECT_NEAR(s.centre[0], 0.5, 1e-14);
}

TEST(MeshSurvey, MeshersAgreeWithTheirQuadrature) {
  MeshSize size;
  size.unknowns = 3000;
  for (const ElementType type : {ElementType::hex8, ElementType::hex20}) {
    size.type = type;
    const Mesh rotor = make_bladed_rotor({}, size);
    EXPECT_NEAR(volume_integrals(rotor).volume / mesh_volume(rotor), 1, 1e-12);
  }
}

TEST(MeshSurvey, DefectsAreFound) {
  Mesh mesh = one(ElementType::hex8, kUnitCube);
  mesh.nodes.push_back({9, 9, 9});  // of no element
  for (Point p : kUnitCube) {
    p[0] += 1;
    mesh.nodes.push_back(p);  // beside the first, with nodes of its own
  }
  mesh.add_element(ElementType::hex8, std::array<Index, 8>{9, 10, 11, 12, 13, 14, 15, 16});
  mesh.add_element(ElementType::hex8, std::array<Index, 8>{13, 14, 15, 16, 9, 10, 11, 12});  // inside out
  std::string all;
  const MeshSurvey s = survey_mesh(mesh);
  for (const std::string& defect : s.defects) all += defect + "\n";
  for (const char* part :
       {"1 nodes belong to no element", "element 3 is inverted", "2 pieces that share no node, with the nodes 1, 10",
        "4 nodes lie where another lies, for instance 10 on 2"})
    EXPECT_NE(all.find(part), std::string::npos) << part << "\n" << all;
  EXPECT_EQ(survey_mesh(Mesh{}).solids, 0);
}

TEST(MeshSurvey, UnitsAreGuessed) {
  Mesh mesh = one(ElementType::hex8, kUnitCube);
  EXPECT_EQ(survey_mesh(mesh).units.substr(0, 2), "m ");
  for (Point& p : mesh.nodes) p[0] *= 200;
  EXPECT_EQ(survey_mesh(mesh).units.substr(0, 2), "mm");
  mesh.materials = {{"steel", 2.1e11, 0.3, 7850}};
  EXPECT_EQ(survey_mesh(mesh).units.substr(0, 2), "m,");
  mesh.materials = {{"steel", 2.1e5, 0.3, 7.85e-9}};
  EXPECT_EQ(survey_mesh(mesh).units.substr(0, 2), "mm");
}

// Ends of flat and of round bodies; none where a file names a part of its surface.
TEST(MeshSides, EndsOfAMesh) {
  Mesh mesh = one(ElementType::hex8, kUnitCube);
  ASSERT_TRUE(add_side_sets(mesh));
  EXPECT_EQ(mesh.face_sets.size(), 6U);
  for (const auto& [name, faces] : mesh.face_sets) {
    ASSERT_EQ(faces.size(), 1U) << name;
    for (const Index n : mesh.face_nodes(faces[0]))
      EXPECT_EQ(mesh.nodes[static_cast<std::size_t>(n)][static_cast<std::size_t>(name[0] - 'x')], name[1] - '0')
          << name;
  }
  EXPECT_FALSE(add_side_sets(mesh));
  Mesh named = one(ElementType::hex8, kUnitCube);
  named.face_sets["foot"] = {{0, 0}};
  EXPECT_FALSE(add_side_sets(named));
  Mesh whole = one(ElementType::hex8, kUnitCube);
  whole.face_sets["all"] = whole.boundary_faces();
  EXPECT_TRUE(add_side_sets(whole));
  Mesh tip = one(ElementType::tet4, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});  // nothing is flat at x = 1
  ASSERT_TRUE(add_side_sets(tip));
  for (const auto& [name, faces] : tip.face_sets) EXPECT_FALSE(faces.empty()) << name;
}

TEST(MeshNames, KeptElementsKeepTheirNames) {
  Mesh mesh = one(ElementType::hex8, kUnitCube);
  mesh.nodes.push_back({3, 3, 3});
  mesh.add_element(ElementType::line2, std::array<Index, 2>{6, 8});
  mesh.element_labels = {17, 18};
  mesh.element_sets = {{"solid", {0}}, {"beam", {1}}};
  mesh.face_sets["top"] = {{0, 1}};
  mesh.node_sets["end"] = {8};
  const std::array<Index, 1> solid = {0};
  keep_elements(mesh, solid);
  EXPECT_EQ(mesh.drop_unused_nodes(), 1);
  EXPECT_EQ(mesh.element_count(), 1);
  EXPECT_EQ(mesh.element_label(0), 17);
  EXPECT_FALSE(mesh.element_sets.contains("beam"));
  EXPECT_EQ(mesh.face_set("TOP").size(), 1U);
  EXPECT_TRUE(mesh.node_sets["end"].empty());
}

}  // namespace mesh_survey_test
}  // namespace espalier::dynamics::test
