#include <cmath>
#include <numbers>

#include "matrix/generators/families.hpp"

namespace espalier::matrix {

namespace {

constexpr double kShellYoung = 1.0;
constexpr double kShellPoisson = 0.3;
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

}  // namespace

std::unique_ptr<GroupModel> make_shell(Index nx, Index ny, Randomness random) {
  std::vector<HexStiffness> stiffness;  // by arc position
  stiffness.reserve(at(ny));
  for (Index y = 0; y < ny; ++y) stiffness.push_back(hex8_stiffness(shell_corners(y, ny), kShellYoung, kShellPoisson));
  return make_clamped_box({nx, ny, 1}, std::move(stiffness), random);
}

}  // namespace espalier::matrix
