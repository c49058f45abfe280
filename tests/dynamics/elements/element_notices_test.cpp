// Elements that lock, or lose their stability, are named before anyone believes them, and others are not. Truth: the
// table of docs/guide/elements.md, which bench/dynamics/element_table.py makes.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace element_notices_test {

using Point = std::array<int, 3>;
using Place = std::function<std::array<double, 3>(double u, double v, double w)>;

/// A mesh file of a grid of nx x ny x nz cells; place() of coordinates in [0, 1].
class Grid {
 public:
  Grid(Point cells, Place place) : cells_(cells), place_(std::move(place)) {}

  [[nodiscard]] std::string text(const std::string& type) {
    std::string elements;
    int count = 0;
    const auto add = [&](const std::vector<Point>& points) {
      elements += std::to_string(++count);
      for (std::size_t k = 0; k < points.size(); ++k)
        elements += (k == 10 ? ",\n" : ", ") + std::to_string(label(points[k]));
      elements += "\n";
    };
    for (int i = 0; i < cells_[0]; ++i)
      for (int j = 0; j < cells_[1]; ++j)
        for (int k = 0; k < cells_[2]; ++k) {
          const auto at = [&](int a, int b, int c) { return Point{2 * i + a, 2 * j + b, 2 * k + c}; };
          std::vector<Point> hex = {at(0, 0, 0), at(2, 0, 0), at(2, 2, 0), at(0, 2, 0),
                                    at(0, 0, 2), at(2, 0, 2), at(2, 2, 2), at(0, 2, 2)};
          if (type == "C3D4") {  // Kuhn's six, about the diagonal 0-6
            for (const auto& [a, b] : {std::pair{1, 2}, {2, 3}, {3, 7}, {7, 4}, {4, 5}, {5, 1}})
              add({hex[0], hex[static_cast<std::size_t>(a)], hex[static_cast<std::size_t>(b)], hex[6]});
            continue;
          }
          if (type == "C3D20") {
            for (const Point& p : {at(1, 0, 0), at(2, 1, 0), at(1, 2, 0), at(0, 1, 0), at(1, 0, 2), at(2, 1, 2),
                                   at(1, 2, 2), at(0, 1, 2), at(0, 0, 1), at(2, 0, 1), at(2, 2, 1), at(0, 2, 1)})
              hex.push_back(p);
          }
          add(hex);
        }
    return "*NODE\n" + nodes_ + "*ELEMENT, TYPE=" + type + "\n" + elements;
  }

 private:
  int label(const Point& p) {
    const auto [it, fresh] = labels_.emplace(p, static_cast<int>(labels_.size()) + 1);
    if (fresh) {
      const auto part = [&](std::size_t d) { return 0.5 * p[d] / cells_[d]; };
      const auto x = place_(part(0), part(1), part(2));
      nodes_ += fmt::format("{}, {:.12g}, {:.12g}, {:.12g}\n", it->second, x[0], x[1], x[2]);
    }
    return it->second;
  }
  Point cells_;
  Place place_;
  std::map<Point, int> labels_;
  std::string nodes_;
};

std::string notices_of(const std::string& mesh, const std::string& options) {
  const ScratchFolder folder;
  std::ofstream(folder.path() + "/grid.inp") << mesh;
  const std::string path = folder.path() + "/model.toml";
  std::ofstream(path) << "[bodies.part]\ntype = \"solid\"\nmesh = { file = \"grid.inp\" }\nmaterial = { young = 1, "
                         "poisson = 0.3, density = 1 }\n"
                      << options << "\n[integrator]\nend = 1e-3\n";
  Simulation s;
  Status status = s.load(path);
  if (status.ok()) status = s.run();
  EXPECT_TRUE(status.ok()) << status.message;
  std::string all;
  for (const std::string& notice : s.summary().notices) all += notice + "\n";
  return all;
}

Place box(double x, double y, double z) {
  return [=](double u, double v, double w) { return std::array{x * u, y * v, z * w}; };
}

/// A bar that lies across the axes.
std::array<double, 3> diagonal(double u, double v, double w) {
  return {6 * u - 0.5 * v - 0.5 * w, 6 * u + v, 6 * u - 0.5 * v + 0.5 * w};
}

/// A quarter of a cylinder.
Place arc(double thickness) {
  return [=](double u, double v, double w) {
    const double r = 1 + thickness * (w - 0.5), angle = 0.5 * std::numbers::pi * u;
    return std::array{r * std::cos(angle), 0.2 * v, -r * std::sin(angle)};
  };
}

TEST(ElementNotices, LinearElementsThatLockInBending) {
  const std::string says = "which lock";
  EXPECT_NE(notices_of(Grid({10, 1, 1}, box(10, 1, 1)).text("C3D4"), "").find(says), std::string::npos);
  EXPECT_NE(notices_of(Grid({10, 1, 1}, diagonal).text("C3D4"), "").find(says), std::string::npos);
  EXPECT_NE(notices_of(Grid({12, 2, 1}, arc(0.05)).text("C3D4"), "").find(says), std::string::npos);
  const std::string full = "hex8 = \"full\"";
  EXPECT_NE(notices_of(Grid({10, 1, 1}, box(10, 1, 1)).text("C3D8"), full).find(says), std::string::npos);
  EXPECT_NE(notices_of(Grid({12, 2, 1}, arc(0.05)).text("C3D8"), full).find(says), std::string::npos);
  EXPECT_NE(
      notices_of(Grid({10, 1, 1}, box(10, 1, 1)).text("C3D8"), "hex8 = \"mean-dilatation\"").find("mean-dilatation"),
      std::string::npos);
  EXPECT_NE(notices_of(Grid({10, 1, 1}, box(10, 1, 1)).text("C3D8"), full + "\nreduce = { modes = 2 }").find(says),
            std::string::npos);
  // Enhanced ones, blocks, and bars with many elements through the thickness.
  EXPECT_EQ(notices_of(Grid({10, 1, 1}, box(10, 1, 1)).text("C3D8"), ""), "");
  EXPECT_EQ(notices_of(Grid({3, 3, 3}, box(1, 1, 1)).text("C3D8"), full), "");
  EXPECT_EQ(notices_of(Grid({3, 3, 3}, box(1, 1, 1)).text("C3D4"), ""), "");
  EXPECT_EQ(notices_of(Grid({30, 6, 6}, box(5, 1, 1)).text("C3D8"), full), "");
}

TEST(ElementNotices, FullHex20InThinCurvedWalls) {
  const std::string says = "reduced_hex20 = true";
  EXPECT_NE(notices_of(Grid({12, 1, 1}, arc(0.01)).text("C3D20"), "").find(says), std::string::npos);
  EXPECT_EQ(notices_of(Grid({12, 1, 1}, arc(0.01)).text("C3D20"), says), "");
  EXPECT_EQ(notices_of(Grid({12, 1, 1}, arc(0.1)).text("C3D20"), ""), "");
  EXPECT_EQ(notices_of(Grid({12, 1, 1}, box(1.57, 0.2, 0.01)).text("C3D20"), ""), "");
}

/// A block under pressure on both ends, so that it is compressed to `stretch`.
std::string compressed(double stretch, const std::string& divisions, const std::string& hex8) {
  const double strain = 0.5 * (stretch * stretch - 1), pressure = -strain * stretch / (1 - 0.6 * strain);
  const Simulation s = simulated(fmt::format(
      "[bodies.block]\ntype = \"solid\"\nmesh = {{ part = \"block\", lx = 1, ly = 1, lz = 1, divisions = {} }}\n"
      "material = {{ young = 1, poisson = 0.3, density = 1 }}\nhex8 = \"{}\"\n[joints.hold]\ntype = \"fixed\"\nattach "
      "= \"mean\"\na = {{ body = \"ground\", point = [0, 0.5, 0.5] }}\nb = {{ body = \"block\", face = \"x0\" "
      "}}\n[forces]\nleft = {{ type = \"pressure\", body = \"block\", face = \"x0\", pressure = {:.17g} }}\nright = {{ "
      "type = \"pressure\", body = \"block\", face = \"x1\", pressure = {:.17g} }}\n[statics]\n",
      divisions, hex8, pressure, pressure));
  std::string all;
  for (const std::string& notice : s.summary().notices)
    if (notice.find("compressed to") != std::string::npos) all += notice;
  return all;
}

TEST(ElementNotices, EnhancedStrainsUnderCompression) {
  EXPECT_NE(compressed(0.9, "[8, 2, 2]", "enhanced").find("compressed to 0.90"), std::string::npos);
  EXPECT_NE(compressed(0.93, "[8, 2, 2]", "shell").find("mean-dilatation"), std::string::npos);
  EXPECT_EQ(compressed(0.97, "[8, 2, 2]", "enhanced"), "");
  EXPECT_EQ(compressed(0.9, "[2, 2, 2]", "enhanced"), "");  // not flat
  EXPECT_EQ(compressed(0.9, "[8, 2, 2]", "mean-dilatation"), "");
}

}  // namespace element_notices_test
}  // namespace espalier::dynamics
