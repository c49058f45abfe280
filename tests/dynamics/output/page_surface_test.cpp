// The drawn surface of bodies. Truth: volumes by the divergence theorem, closed surfaces, stress of uniform strain.
#include <gtest/gtest.h>

#include <map>

#include "base/at.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"
#include "dynamics/page/drawn.hpp"
#include "dynamics/page/nodal_stress.hpp"

namespace espalier::dynamics {
namespace page_surface_test {

using page::Drawn;

constexpr const char* kSteel = "material = { young = 2e11, poisson = 0.3, density = 7800 }\n";

/// A cube of edge 1 in five tetrahedra, as a mesh file of linear or quadratic elements.
class CubeOfTets {
 public:
  explicit CubeOfTets(bool quadratic) : path_(folder_.path() + "/cube.inp") {
    std::ofstream out(path_);
    out << "*NODE\n";
    for (int k = 0; k < 27; ++k)
      out << k + 1 << ", " << 0.5 * (k % 3) << ", " << 0.5 * (k / 3 % 3) << ", " << 0.5 * (k / 9) << "\n";
    out << "*ELEMENT, TYPE=" << (quadratic ? "C3D10" : "C3D4") << "\n";
    const int tets[5][4] = {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}};  // corners by bits
    const int edges[6][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};
    int label = 0;
    for (const auto& tet : tets) {
      std::vector<std::array<int, 3>> at;
      for (const int corner : tet) at.push_back({2 * (corner & 1), 2 * (corner >> 1 & 1), 2 * (corner >> 2)});
      const std::array<int, 3> u = minus(at[1], at[0]), v = minus(at[2], at[0]), w = minus(at[3], at[0]);
      if (u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0]) <
          0)
        std::swap(at[0], at[1]);
      for (const auto& [a, b] : edges)
        if (quadratic) at.push_back({(at[a][0] + at[b][0]) / 2, (at[a][1] + at[b][1]) / 2, (at[a][2] + at[b][2]) / 2});
      out << ++label;
      for (const auto& x : at) out << ", " << 1 + x[0] + 3 * x[1] + 9 * x[2];
      out << "\n";
    }
  }
  [[nodiscard]] std::string body() const { return "type = \"solid\"\nmesh = { file = \"" + path_ + "\" }\n" + kSteel; }

 private:
  static std::array<int, 3> minus(const std::array<int, 3>& a, const std::array<int, 3>& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  }
  ScratchFolder folder_;
  std::string path_;
};

std::string block_of_bricks(const std::string& element, const std::string& sizes, const std::string& divisions) {
  return "type = \"solid\"\nmesh = { part = \"block\", " + sizes + ", divisions = " + divisions + ", element = \"" +
         element + "\" }\n" + kSteel;
}

std::unique_ptr<model::Mechanism> built_body(const std::string& body) {
  return built("[bodies.b]\n" + body + "[integrator]\nend = 1\n");
}

/// Volume within the triangles, positive where they are seen from outside.
double volume_within(const Drawn& drawn, const std::vector<double>& points) {
  double volume = 0;
  for (const auto& [a, b, c] : drawn.triangles()) {
    const Eigen::Map<const Vec3> x(&points[3 * at(a)]), y(&points[3 * at(b)]), z(&points[3 * at(c)]);
    volume += x.dot(y.cross(z)) / 6;
  }
  return volume;
}

/// Each edge of each triangle is there as often in the other direction.
bool is_closed(const Drawn& drawn) {
  std::map<std::pair<Index, Index>, int> ways;
  for (const auto& t : drawn.triangles())
    for (std::size_t i = 0; i < 3; ++i) {
      const Index a = t[i], b = t[(i + 1) % 3];
      ways[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  return std::all_of(ways.begin(), ways.end(), [](const auto& way) { return way.second == 0; });
}

/// @param volume  of the polyhedron that stands for the body
void expect_closed(const std::string& body, double volume, double tolerance) {
  const auto mechanism = built_body(body);
  Drawn drawn(*mechanism);
  State s(mechanism->system.sizes());
  mechanism->system.initial(s.q, s.v);
  Drawn::Place place;
  drawn.place(s, place);
  ASSERT_FALSE(drawn.triangles().empty()) << body;
  EXPECT_TRUE(is_closed(drawn)) << body;
  EXPECT_NEAR(volume_within(drawn, drawn.all_points(place)) / volume, 1, tolerance) << body;
}

TEST(PageSurface, IsClosedAndHoldsTheVolume) {
  for (const char* element : {"hex8", "hex20"})
    expect_closed(block_of_bricks(element, "lx = 2, ly = 1, lz = 0.5", "[3, 2, 1]"), 1, 1e-12);
  for (const bool quadratic : {false, true}) expect_closed(CubeOfTets(quadratic).body(), 1, 1e-12);
  const std::string line = "start = [0, 0, 0]\nend = [2, 0, 0]\nelements = 3\n" + std::string(kSteel);
  expect_closed("type = \"beam\"\nheight = 0.1\nwidth = 0.05\n" + line, 0.01, 1e-9);
  expect_closed("type = \"beam\"\nradius = 0.1\n" + line, 0.06, 1e-9);  // 12 points hold 3 / pi of a circle
  expect_closed("type = \"cable\"\nradius = 0.1\n" + line, 0.06, 1e-9);
  expect_closed(
      "type = \"shell\"\nx = [2, 0, 0]\ny = [0, 1, 0]\nnx = 3\nny = 2\nthickness = 0.1\n" + std::string(kSteel), 0.2,
      1e-12);
  expect_closed("type = \"rigid\"\nmass = 1\ninertia = [1, 1, 1]\nbox = [2, 1, 0.5]\nposition = [3, 4, 5]\n", 1, 1e-6);
}

/// Principal and von Mises stress at the surface, after `move` has moved the nodes, against `truth` at their first
/// places.
template <class Move, class Truth>
void expect_stress(const std::string& body, const Move& move, const Truth& truth) {
  const auto mechanism = built_body(body);
  Drawn drawn(*mechanism);
  const page::NodalStress stress(*mechanism, drawn);
  State s(mechanism->system.sizes());
  mechanism->system.initial(s.q, s.v);
  Drawn::Place rest;
  drawn.place(s, rest);
  for (std::size_t k = 0; k < s.q.size(); k += 3) {
    const Vec3 moved = move(Vec3(&s.q[k]));
    std::copy_n(moved.data(), 3, &s.q[k]);
  }
  const auto [von_mises, principal, strain] = stress.evaluate(stress.keep(s));
  ASSERT_EQ(von_mises.size(), drawn.labels().size());
  for (std::size_t k = 0; k < von_mises.size(); ++k) {
    const double expected = truth(Vec3(&rest.points[3 * k]));
    EXPECT_NEAR(principal[k], expected, 5) << body;
    EXPECT_NEAR(von_mises[k], std::abs(expected), 5) << body;
    EXPECT_NEAR(2e11 * strain[k], expected, 5) << body;  // under stress along one axis
  }
}

// Truth: with free sides, a strain e along x has the stress E e.
TEST(PageStress, IsThatOfUniformStrain) {
  constexpr double kStrain = -1e-6;
  const auto move = [](const Vec3& x) {
    return Vec3(x[0] * (1 + kStrain), x[1] * (1 - 0.3 * kStrain), x[2] * (1 - 0.3 * kStrain));
  };
  const auto truth = [](const Vec3&) { return 2e11 * kStrain; };
  for (const char* element : {"hex8", "hex20"})
    expect_stress(block_of_bricks(element, "lx = 2, ly = 1, lz = 0.5", "[3, 2, 1]"), move, truth);
  for (const bool quadratic : {false, true}) expect_stress(CubeOfTets(quadratic).body(), move, truth);
}

// Truth: pure bending, u = k x z, v = -nu k y z, w = -k (x^2 + nu (z^2 - y^2)) / 2, has the stress E k z along x alone.
// Quadratic elements hold it exactly, and the linear law through their points does, up to the surface.
TEST(PageStress, OfBendingIsExactInQuadraticElements) {
  constexpr double kBend = 1e-6, kNu = 0.3;
  const auto move = [](const Vec3& x) {
    const double y = x[1] - 0.5, z = x[2] - 0.5;
    return Vec3(x[0] + kBend * x[0] * z, x[1] - kNu * kBend * y * z,
                x[2] - 0.5 * kBend * (x[0] * x[0] + kNu * (z * z - y * y)));
  };
  const auto truth = [](const Vec3& x) { return 2e11 * kBend * (x[2] - 0.5); };
  expect_stress(block_of_bricks("hex20", "lx = 1, ly = 1, lz = 1", "[2, 1, 2]"), move, truth);
  expect_stress(CubeOfTets(true).body(), move, truth);
}

}  // namespace page_surface_test
}  // namespace espalier::dynamics
