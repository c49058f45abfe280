// The mesh of a tyre. Truth: volume and area of a torus (Pappus), and a closed surface.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <string>

#include "dynamics/meshers/tyre.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace tyre_mesh_test {

using Vec3 = Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;

Vec3 place(const Mesh& mesh, Index node) {
  const Point& x = mesh.nodes[static_cast<std::size_t>(node)];
  return {x[0], x[1], x[2]};
}

struct Skin {
  double area = 0, volume = 0;  // the volume that it encloses
  Vec3 sum = Vec3::Zero();      // of the areas as vectors
};

/// The skin of flat triangles from the middle of each face to its corners.
Skin skin_of(const Mesh& mesh, const std::vector<MeshFace>& faces) {
  Skin skin;
  for (const MeshFace& face : faces) {
    const std::vector<Index> nodes = mesh.face_nodes(face);
    const Vec3 middle =
        0.25 * (place(mesh, nodes[0]) + place(mesh, nodes[1]) + place(mesh, nodes[2]) + place(mesh, nodes[3]));
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec3 a = place(mesh, nodes[k]), b = place(mesh, nodes[(k + 1) % 4]);
      const Vec3 area = 0.5 * (a - middle).cross(b - middle);
      skin.area += area.norm();
      skin.sum += area;
      skin.volume += middle.dot(area) / 3;
    }
  }
  return skin;
}

TEST(TyreMesh, IsATorus) {
  TyreShape s;
  const double middle = s.radius - 0.5 * s.thickness - s.section_radius;
  double before = 0;
  for (const int fine : {1, 2, 4}) {
    const Mesh mesh = make_tyre(s, 16 * fine, 8 * fine, 1);
    const double truth = 4 * kPi * kPi * middle * s.section_radius * s.thickness;
    const double error = skin_of(mesh, mesh.boundary_faces()).volume / truth - 1;
    EXPECT_LT(std::abs(error), 0.16 / (fine * fine));
    if (fine > 1) {
      EXPECT_NEAR(before / error, 4, 0.5);
    }
    before = error;
    const Skin inside = skin_of(mesh, mesh.face_set("inside"));
    EXPECT_LT(inside.sum.norm(), 1e-12 * inside.area);  // air has no resultant
    const double outside = skin_of(mesh, mesh.face_set("outside")).area,
                 seat = skin_of(mesh, mesh.face_set("rim")).area;
    EXPECT_NEAR(outside + seat + inside.area, skin_of(mesh, mesh.boundary_faces()).area, 1e-12);
  }
}

TEST(TyreMesh, SectorsAreTheRim) {
  TyreShape s;
  s.sectors = 6;
  const Mesh mesh = make_tyre(s, 12, 9, 2);
  std::size_t faces = 0;
  for (int k = 0; k < s.sectors; ++k) {
    const auto& sector = mesh.face_set("rim_" + std::to_string(k));
    faces += sector.size();
    for (const MeshFace& face : sector)
      for (const Index n : mesh.face_nodes(face)) {
        const Vec3 x = place(mesh, n);
        const double turn = std::remainder(std::atan2(x[2], x[0]) - 2 * kPi * (k + 0.5) / s.sectors, 2 * kPi);
        EXPECT_LT(std::abs(turn), kPi / s.sectors + 1e-9);
        EXPECT_LT(std::abs(x[1]), (s.section_radius + 0.5 * s.thickness) * std::sin(s.opening) + 1e-12);
      }
  }
  EXPECT_EQ(faces, mesh.face_set("rim").size());
  const Mesh sized = make_tyre(s, MeshSize{5000, ElementType::hex8, nullptr});
  EXPECT_NEAR(3.0 * static_cast<double>(sized.nodes.size()), 5000, 2500);
}

TEST(TyreMesh, MistakesAreNamed) {
  const auto mistake = [](const std::string& keys) {
    Simulation simulation;
    const Status status = simulation.load_text("[bodies.t]\ntype = \"solid\"\nmesh = { part = \"tyre\", " + keys +
                                                   " }\nmaterial = { young = 1, density = 1 }\n[integrator]\nend = 1\n",
                                               "m.toml");
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    return status.message;
  };
  EXPECT_NE(mistake("radius = 0.2").find("a radius above"), std::string::npos);
  EXPECT_NE(mistake("thickness = 0.3").find("thickness < section_radius"), std::string::npos);
  EXPECT_NE(mistake("opening = 2").find("opening between 0 and pi/2"), std::string::npos);
  EXPECT_NE(mistake("divisions = [30, 8, 1]").find("multiple of 8"), std::string::npos);
  EXPECT_NE(mistake("divisions = [32, 1, 1]").find("two or more across"), std::string::npos);
  EXPECT_NE(mistake("sectors = 2").find("sectors"), std::string::npos);
}

}  // namespace tyre_mesh_test
}  // namespace espalier::dynamics
