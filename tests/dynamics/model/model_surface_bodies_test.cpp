// Rigid bodies from closed surfaces. Truth: a box (closed form), a sphere of many triangles (close to the ball), the
// same in text and bytes.
#include <fmt/format.h>

#include <cstring>
#include <numbers>

#include "dynamics/contact/geometry/surface_inertia.hpp"
#include "dynamics/model/built_model.hpp"
#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace {

using StlTriangle = std::array<Vec3, 3>;

/// A box with its corner at `corner`, its triangles looking outwards.
std::vector<StlTriangle> stl_box(const Vec3& corner, const Vec3& size) {
  std::vector<StlTriangle> out;
  for (int axis = 0; axis < 3; ++axis)
    for (const bool upper : {false, true}) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      Vec3 p = corner;
      if (upper) p[axis] += size[axis];
      const Vec3 du = size[u] * Vec3::Unit(u), dv = size[v] * Vec3::Unit(v);
      const Vec3 a = p, b = p + du, c = p + du + dv, d = p + dv;
      if (upper) {
        out.push_back({a, b, c});
        out.push_back({a, c, d});
      } else {
        out.push_back({a, c, b});
        out.push_back({a, d, c});
      }
    }
  return out;
}

std::string text_stl(const std::vector<StlTriangle>& triangles) {
  std::string text = "solid part\n";
  for (const StlTriangle& t : triangles) {
    text += "facet normal 0 0 0\n outer loop\n";
    for (const Vec3& p : t) text += fmt::format("  vertex {:.17g} {:.17g} {:.17g}\n", p[0], p[1], p[2]);
    text += " endloop\nendfacet\n";
  }
  return text + "endsolid part\n";
}

std::string binary_stl(const std::vector<StlTriangle>& triangles) {
  std::string bytes(80, ' ');
  const auto append = [&](auto value) {
    char raw[sizeof(value)];
    std::memcpy(raw, &value, sizeof(value));
    bytes.append(raw, sizeof(value));
  };
  append(static_cast<std::uint32_t>(triangles.size()));
  for (const StlTriangle& t : triangles) {
    for (int k = 0; k < 3; ++k) append(0.0F);
    for (const Vec3& p : t)
      for (int k = 0; k < 3; ++k) append(static_cast<float>(p[k]));
    append(std::uint16_t{0});
  }
  return bytes;
}

struct ModelSurfaceBodies : testing::Test {
  std::string write(const std::string& name, const std::string& content) {
    const std::string path = folder.path() + "/" + name;
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }
  static std::string model(const std::string& path, const std::string& more) {
    return "[bodies.part]\ntype = \"rigid\"\nmesh = { file = \"" + path + "\" }\n" + more + "\n[integrator]\nend = 1\n";
  }
  ScratchFolder folder;
};

TEST_F(ModelSurfaceBodies, ABoxInTextAndBytes) {
  const Vec3 size(2, 1, 0.5), corner(10, -4, 1);
  for (const bool bytes : {false, true}) {
    const auto triangles = stl_box(corner, size);
    const std::string path = write("box.stl", bytes ? binary_stl(triangles) : text_stl(triangles));
    const auto mechanism = built(model(path, "density = 3"));
    const RigidBodyData& d = std::get<model::RigidSpec>(mechanism->bodies.at(0).spec.shape).data;
    EXPECT_NEAR(d.mass, 3, 1e-13);
    EXPECT_NEAR((Vec3(d.position) - (corner + 0.5 * size)).norm(), 0, 1e-13);
    const Vec3 square = size.cwiseAbs2();
    const Mat3 right = (3.0 / 12 * (square.sum() * Vec3::Ones() - square)).asDiagonal();
    EXPECT_NEAR((d.inertia - right).norm(), 0, 1e-12);
  }
  const std::string path = write("mm.stl", text_stl(stl_box(corner, size)));
  const auto scaled = built("[bodies.part]\ntype = \"rigid\"\nmesh = { file = \"" + path +
                            "\", scale = 0.1 }\nmass = 7\nposition = [1, 2, 3]\n[integrator]\nend = 1\n");
  const RigidBodyData& d = std::get<model::RigidSpec>(scaled->bodies.at(0).spec.shape).data;
  EXPECT_EQ(d.mass, 7);
  EXPECT_NEAR(d.inertia(0, 0), 7.0 / 12 * (0.1 * 0.1 + 0.05 * 0.05), 1e-15);
  EXPECT_NEAR((Vec3(d.position) - Vec3(1, 2, 3)).norm(), 0, 0);
}

// Truth: a ball, and the parallel axes of a hollow box that lies aside (a box within a box, turned inside out).
TEST_F(ModelSurfaceBodies, ABallAndAHollowBox) {
  std::vector<StlTriangle> ball;
  const int n = 60;
  const auto at = [&](int i, int j) {
    const double polar = std::numbers::pi * i / n, around = std::numbers::pi * (j % (2 * n)) / n;
    return i == 0   ? Vec3(0, 0, 1)
           : i == n ? Vec3(0, 0, -1)
                    : Vec3(std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around), std::cos(polar));
  };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 2 * n; ++j) {
      if (i < n - 1) ball.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      if (i > 0) ball.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  const auto solid = contact::solid_inside(contact::read_surface(write("ball.stl", text_stl(ball)), 2), "ball");
  const double volume = 4.0 / 3 * std::numbers::pi * 8;
  EXPECT_NEAR(solid.volume, volume, 2e-3 * volume);
  EXPECT_NEAR(solid.centre.norm(), 0, 1e-13);
  EXPECT_NEAR((solid.inertia / (solid.volume * 0.4 * 4) - Mat3::Identity()).norm(), 0, 3e-3);
  std::vector<StlTriangle> hollow = stl_box({5, 0, 0}, {2, 2, 2});
  for (StlTriangle t : stl_box({5.5, 0.5, 0.5}, {1, 1, 1})) {
    std::swap(t[1], t[2]);
    hollow.push_back(t);
  }
  const auto shell = contact::solid_inside(contact::read_surface(write("hollow.stl", text_stl(hollow)), 1), "hollow");
  EXPECT_NEAR(shell.volume, 7, 1e-13);
  EXPECT_NEAR((shell.centre - Vec3(6, 1, 1)).norm(), 0, 1e-13);
  EXPECT_NEAR(shell.inertia(0, 0), 8.0 / 12 * 8 - 1.0 / 12 * 2, 1e-12);
}

// Pieces beside each other and in cavities count once; what looks inwards without being a cavity, or lies within
// another piece, has no volume that one could know.
TEST_F(ModelSurfaceBodies, SeveralPieces) {
  const auto inwards = [](std::vector<StlTriangle> box) {
    for (StlTriangle& t : box) std::swap(t[1], t[2]);
    return box;
  };
  const auto volume = [&](const std::vector<std::vector<StlTriangle>>& pieces) {
    std::vector<StlTriangle> all;
    for (const auto& piece : pieces) all.insert(all.end(), piece.begin(), piece.end());
    return contact::solid_inside(contact::read_surface(write("pieces.stl", text_stl(all)), 1), "pieces").volume;
  };
  const auto large = stl_box({0, 0, 0}, {4, 4, 4}), middle = stl_box({1, 1, 1}, {2, 2, 2});
  const auto small = stl_box({1.5, 1.5, 1.5}, {1, 1, 1}), beside = stl_box({5, 0, 0}, {1, 1, 1});
  EXPECT_NEAR(volume({large, beside}), 65, 1e-12);
  EXPECT_NEAR(volume({small, inwards(middle), beside, large}), 64 - 8 + 1 + 1, 1e-12);
  const auto says = [&](const std::vector<std::vector<StlTriangle>>& pieces) -> std::string {
    try {
      static_cast<void>(volume(pieces));
    } catch (const Error& error) {
      return error.what();
    }
    return "taken";
  };
  EXPECT_NE(says({large, inwards(beside)}).find("look inwards, and lies in no other piece"), std::string::npos);
  EXPECT_NE(says({large, middle}).find("lies inside of another one and would count twice"), std::string::npos);
  EXPECT_NE(says({large, inwards(middle), inwards(small)}).find("look inwards"), std::string::npos);
}

TEST_F(ModelSurfaceBodies, MistakesAreNamed) {
  auto triangles = stl_box({0, 0, 0}, {2, 2, 2});
  triangles.erase(triangles.begin() + 2, triangles.begin() + 4);  // the side x = 2 or the like
  const auto says = [&](const std::string& text, const std::string& part) {
    try {
      static_cast<void>(built(text));
      ADD_FAILURE() << "no error: " << part;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  const std::string open = write("open.stl", text_stl(triangles));
  says(model(open, "density = 1"),
       "4 of its edges have a triangle on one side alone; the first hole has 4 edges around (2, 1, 1)");
  const std::string good = write("good.stl", text_stl(stl_box({0, 0, 0}, {2, 2, 2})));
  says(model(good, ""), "needs one of 'mass' and 'density'");
  says(model(good, "mass = 1\ndensity = 1"), "needs one of 'mass' and 'density'");
  says(model(good, "mass = 1\nbox = [1, 1, 1]"), "does not go with 'mesh'");
  says(model(folder.path() + "/none.stl", "density = 1"), "none.stl");
  const std::string bytes = binary_stl(stl_box({0, 0, 0}, {2, 2, 2}));
  says(model(write("cut.stl", bytes.substr(0, bytes.size() - 7)), "density = 1"), "is no STL");
}

}  // namespace
}  // namespace espalier::dynamics
