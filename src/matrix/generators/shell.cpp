#include <cmath>
#include <numbers>

#include "matrix/generators/families.hpp"
#include "matrix/generators/hex8.hpp"

namespace espalier::matrix {

namespace {

constexpr double kYoung = 1.0;
constexpr double kPoisson = 0.3;
constexpr double kThickness = 0.3;
constexpr double kArc = 80.0 * std::numbers::pi / 180.0;

// Corners of the element that begins at arc position `station` of `ny`: x along the axis, then the arc, then outwards.
HexCorners shell_corners(Index station, Index ny) {
  const double radius = ny / kArc;
  HexCorners corners{};
  for (std::size_t c = 0; c < 8; ++c) {
    const double angle = kArc * ((station + static_cast<double>(c >> 1 & 1)) / ny - 0.5);
    const double r = radius + ((c >> 2 & 1) != 0 ? kThickness / 2 : -kThickness / 2);
    corners[c] = {static_cast<double>(c & 1), r * std::sin(angle), r * std::cos(angle)};
  }
  return corners;
}

class Shell final : public GroupModel {
 public:
  Shell(Index nx, Index ny, Randomness random)
      : grid_{nx, ny, 1}, factors_(element_factors(grid_.elements(), random.seed)), clamped_(2 * (ny + 1)) {
    stiffness_.reserve(static_cast<std::size_t>(ny));
    for (Index y = 0; y < ny; ++y) stiffness_.push_back(hex8_stiffness(shell_corners(y, ny), kYoung, kPoisson));
  }

  [[nodiscard]] Index groups() const override { return static_cast<Index>(grid_.nodes()) - clamped_; }

  void neighbours(Index group, std::vector<Neighbour>& out) const override {
    grid_.for_each_neighbour(place(group), [&](GridPlace q) {
      if (q.x > 0) out.push_back({grid_.node(q) - clamped_, BlockShape::full});
    });
  }

  void block(Index row, Index col, BlockValues& values) const override {
    values.fill(0);
    grid_.for_each_shared_element(place(row), place(col), [&](GridPlace e, std::size_t a, std::size_t b) {
      const double factor = factors_[static_cast<std::size_t>(grid_.element(e))];
      const HexStiffness& stiffness = stiffness_[static_cast<std::size_t>(e.y)];
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) values[3 * i + k] += factor * stiffness[(3 * a + i) * 24 + 3 * b + k];
    });
  }

 private:
  [[nodiscard]] GridPlace place(Index group) const { return grid_.node_place(group + clamped_); }

  HexGrid grid_;
  std::vector<HexStiffness> stiffness_;  // by arc position
  std::vector<double> factors_;
  Index clamped_;
};

}  // namespace

std::unique_ptr<GroupModel> make_shell(Index nx, Index ny, Randomness random) {
  return std::make_unique<Shell>(nx, ny, random);
}

}  // namespace espalier::matrix
