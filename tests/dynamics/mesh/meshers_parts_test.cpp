// Parametric parts: volume, closedness, connectivity, size control, face sets.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>

#include "dynamics/elements/solid.hpp"
#include "dynamics/elements/solid_measures.hpp"
#include "dynamics/meshers/parts.hpp"

namespace espalier::dynamics::test {
namespace meshers_parts_test {

struct MeshedPart {
  std::string name;
  std::function<Mesh(const MeshSize&)> make;
  double volume;  // of the exact shape; negative: not known in closed form
  std::vector<std::string> faces;
};
std::ostream& operator<<(std::ostream& out, const MeshedPart& p) { return out << p.name; }

std::vector<double> coordinates(const Mesh& mesh, Index e) {
  std::vector<double> x;
  for (const Index n : mesh.element(e)) x.insert(x.end(), mesh.nodes[n].begin(), mesh.nodes[n].end());
  return x;
}

double volume(const Mesh& mesh) {
  double sum = 0;
  for (Index e = 0; e < mesh.element_count(); ++e) sum += solid_volume(mesh.type(e), coordinates(mesh, e).data());
  return sum;
}

double cylinder(double radius, double length) { return std::numbers::pi * radius * radius * length; }

/// Area between the eyes and the shank of the figure behind rods: shank quadrilateral minus the two circular segments.
double shank_area(double length, double r1, double w1, double r2, double w2) {
  const double a1 = std::asin(0.5 * w1 / r1), a2 = std::asin(0.5 * w2 / r2);
  const double chord = length - r1 * std::cos(a1) - r2 * std::cos(a2);
  const auto segment = [](double r, double a) { return r * r * (a - std::sin(a) * std::cos(a)); };
  return 0.5 * (w1 + w2) * chord - segment(r1, a1) - segment(r2, a2);
}

std::vector<MeshedPart> parts() {
  const RodShape r;
  const LinkShape l;
  const CrankShape c;
  const GuideShape g;
  const double rod = std::numbers::pi * (r.big_outer * r.big_outer - r.big_inner * r.big_inner +
                                         r.small_outer * r.small_outer - r.small_inner * r.small_inner) +
                     shank_area(r.length, r.big_outer, r.shank_big, r.small_outer, r.shank_small);
  const double link = 2 * std::numbers::pi * (l.outer * l.outer - l.inner * l.inner) +
                      shank_area(l.pitch, l.outer, l.waist, l.outer, l.waist);
  const double web = std::numbers::pi * (c.web_big * c.web_big + c.web_small * c.web_small) +
                     shank_area(c.throw_radius, c.web_big, c.web_neck, c.web_small, c.web_neck);
  const double arc = 0.5 * g.angle * (std::pow(g.radius + g.height, 2) - g.radius * g.radius);
  return {{"block",
           [](const MeshSize& s) {
             return make_block({3, 2, 1}, s);
           },
           6,
           {"x0", "x1", "y0", "y1", "z0", "z1"}},
          {"rod",
           [](const MeshSize& s) { return make_connecting_rod({}, s); },
           rod * r.thickness,
           {"big_bore", "small_bore", "front", "back"}},
          {"link",
           [](const MeshSize& s) { return make_chain_link({}, s); },
           link * l.thickness,
           {"bore_a", "bore_b", "front", "back"}},
          {"crank",
           [](const MeshSize& s) { return make_crank({}, s); },
           2 * web * c.web_thickness + 2 * cylinder(c.journal_radius, c.journal_length) +
               cylinder(c.pin_radius, c.pin_length),
           {"journal_left", "journal_right", "pin", "end_left", "end_right"}},
          {"guide",
           [](const MeshSize& s) { return make_guide({}, s); },
           (2 * g.lead * g.height + arc) * g.width,
           {"running", "base", "start", "end"}},
          {"rotor",
           [](const MeshSize& s) { return make_bladed_rotor({}, s); },
           -1,
           {"bearing_left", "bearing_right", "bore", "end_left", "end_right", "blade_tips"}},
          {"gear",
           [](const MeshSize& s) {
             GearShape small;
             small.teeth = 12;
             small.pressure_angle = 0.45;
             small.bore_radius = 0.005;
             return make_spur_gear(small, s);
           },
           -1,  // GearMesh.VolumeIsThatOfTheProfile
           {"teeth", "bore", "front", "back"}}};
}

class Parts : public testing::TestWithParam<MeshedPart> {};

// Truth: the exact volume (quadratic elements follow circles to third order), with faces between elements shared:
// a boundary that is closed has the divergence theorem, volume = 1/3 integral of x . n.
TEST_P(Parts, VolumeAndClosedBoundary) {
  const Mesh mesh = GetParam().make({3e4, ElementType::hex20});
  const double v = volume(mesh);
  if (GetParam().volume > 0) {
    EXPECT_NEAR(v / GetParam().volume, 1, 3e-4);
  }
  double flux[4] = {};  // sums of n and of x . n over the boundary, by corners (planar pieces: two triangles)
  for (const MeshFace& face : mesh.boundary_faces()) {
    const auto nodes = mesh.face_nodes(face);
    for (const auto& t : {std::array{0, 1, 2}, {0, 2, 3}}) {
      const Point &a = mesh.nodes[nodes[t[0]]], &b = mesh.nodes[nodes[t[1]]], &c = mesh.nodes[nodes[t[2]]];
      for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        const double n = 0.5 * ((b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]));
        flux[i] += n;
        flux[3] += n * (a[i] + b[i] + c[i]) / 9;
      }
    }
  }
  const double area = std::pow(v, 2.0 / 3);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(flux[i], 0, 1e-10 * area) << "the boundary is closed";
  EXPECT_NEAR(flux[3] / v, 1, 0.05) << "its normals point outwards";
}

// Truth: one piece (union-find over elements), every node used, every face set on the boundary and not empty.
TEST_P(Parts, OnePieceWithItsFaceSets) {
  Mesh mesh = GetParam().make({5e3, ElementType::hex8});
  std::vector<Index> parent(mesh.nodes.size());
  std::iota(parent.begin(), parent.end(), 0);
  const std::function<Index(Index)> find = [&](Index n) { return parent[n] == n ? n : parent[n] = find(parent[n]); };
  for (Index e = 0; e < mesh.element_count(); ++e)
    for (const Index n : mesh.element(e)) parent[find(n)] = find(mesh.element(e)[0]);
  for (Index n = 0; n < static_cast<Index>(mesh.nodes.size()); ++n) ASSERT_EQ(find(n), find(0));
  const auto boundary = mesh.boundary_faces();
  for (const std::string& set : GetParam().faces) {
    const auto& faces = mesh.face_set(set);
    EXPECT_GT(faces.size(), 0U) << set;
    for (const MeshFace& face : faces)
      EXPECT_TRUE(std::binary_search(boundary.begin(), boundary.end(), face)) << set << " is not on the boundary";
    EXPECT_EQ(mesh.node_set(set), mesh.nodes_of_faces(faces));
  }
  EXPECT_EQ(mesh.face_sets.size(), GetParam().faces.size());
  EXPECT_EQ(mesh.drop_unused_nodes(), 0);
}

TEST_P(Parts, UnknownsFollowTheWish) {
  for (const ElementType type : {ElementType::hex8, ElementType::hex20})
    for (const double wish : {3e3, 1e5}) {
      const Mesh mesh = GetParam().make({wish, type});
      const double ratio = 3.0 * static_cast<double>(mesh.nodes.size()) / wish;
      EXPECT_GT(ratio, 0.55) << shape_of(type).name << " " << wish;
      EXPECT_LT(ratio, wish < 1e4 ? 2.5 : 1.8) << shape_of(type).name << " " << wish;
    }
}

INSTANTIATE_TEST_SUITE_P(All, Parts, testing::ValuesIn(parts()), [](const auto& p) { return p.param.name; });

TEST(PartShapes, ImpossibleShapesAreRefused) {
  RodShape rod;
  rod.length = 0.04;
  EXPECT_THROW(static_cast<void>(make_connecting_rod(rod, {})), std::invalid_argument);
  CrankShape crank;
  crank.web_big = crank.journal_radius;
  EXPECT_THROW(static_cast<void>(make_crank(crank, {})), std::invalid_argument);
  RotorShape rotor;
  rotor.blades = 1;
  EXPECT_THROW(static_cast<void>(make_bladed_rotor(rotor, {})), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(make_block({1, 1, 1}, 2, 2, 2, ElementType::tet4)), std::invalid_argument);
}

}  // namespace meshers_parts_test
}  // namespace espalier::dynamics::test
