#include "dynamics/contact/geometry/sprocket.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace espalier::dynamics::contact {
namespace {

using std::numbers::pi;

/// The side of one tooth gap at positive angles: from the bottom of the seat on x to the tip, (x, y) each.
std::vector<Eigen::Vector2d> half_gap(const SprocketShape& s, double pitch_radius, double tip_radius) {
  constexpr int kSeat = 10;  // segments
  const double seat = 1.01 * s.roller_radius, half = 0.5 * (140 - 90.0 / s.teeth) * pi / 180;
  std::vector<Eigen::Vector2d> points;
  for (int k = 0; k <= kSeat; ++k) {
    const double turn = half * k / kSeat;  // from the direction to the centre
    points.emplace_back(pitch_radius - seat * std::cos(turn), seat * std::sin(turn));
  }
  // along the tangent (sin, cos) until |x + l t| = tip radius
  const Eigen::Vector2d x = points.back(), t(std::sin(half), std::cos(half));
  const double along = x.dot(t), missing = tip_radius * tip_radius - x.squaredNorm();
  const double length = -along + std::sqrt(along * along + missing);
  constexpr int kFlank = 3;
  for (int k = 1; k <= kFlank; ++k) points.emplace_back(x + length * k / kFlank * t);
  return points;
}

/// A polygon drawn out along z. It goes around the origin anticlockwise, and all of it is seen from there.
TriangleSurface drawn_out(const std::vector<Eigen::Vector2d>& polygon, double width) {
  std::vector<Vec3> points;
  std::vector<std::array<Index, 3>> triangles;
  const auto n = static_cast<Index>(polygon.size());
  for (const double z : {-0.5 * width, 0.5 * width})
    for (const Eigen::Vector2d& p : polygon) points.emplace_back(p[0], p[1], z);
  points.emplace_back(0, 0, -0.5 * width);
  points.emplace_back(0, 0, 0.5 * width);
  for (Index k = 0; k < n; ++k) {
    const Index next = (k + 1) % n;
    triangles.push_back({k, next, n + next});
    triangles.push_back({k, n + next, n + k});
    triangles.push_back({2 * n, next, k});
    triangles.push_back({2 * n + 1, n + k, n + next});
  }
  return {std::move(points), triangles};
}

}  // namespace

TriangleSurface sprocket_surface(const SprocketShape& s) {
  if (s.teeth < 6) throw std::invalid_argument("a sprocket needs at least 6 teeth");
  if (!(s.pitch > 0 && s.roller_radius > 0 && s.width > 0 && s.tip > 0))
    throw std::invalid_argument("the pitch, roller_radius, width and tip of a sprocket must be greater than 0");
  const double half_turn = pi / s.teeth, pitch_radius = 0.5 * s.pitch / std::sin(half_turn);
  const std::vector<Eigen::Vector2d> half = half_gap(s, pitch_radius, pitch_radius + 2 * s.tip * s.roller_radius);
  const double end = std::atan2(half.back()[1], half.back()[0]);
  if (!(end < half_turn))
    throw std::invalid_argument(
        fmt::format("the teeth of the sprocket have no width: rollers of radius {:g} are too large for the pitch {:g}",
                    s.roller_radius, s.pitch));
  std::vector<Eigen::Vector2d> profile;
  for (int tooth = 0; tooth < s.teeth; ++tooth) {
    const Eigen::Rotation2Dd turn(2 * half_turn * tooth);
    for (std::size_t k = half.size(); k-- > 1;) profile.push_back(turn * Eigen::Vector2d(half[k][0], -half[k][1]));
    for (const Eigen::Vector2d& p : half) profile.push_back(turn * p);
  }
  return drawn_out(profile, s.width);
}

}  // namespace espalier::dynamics::contact
