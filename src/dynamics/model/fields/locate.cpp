#include "dynamics/model/fields/locate.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/at.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr double kInside = 1e-6;  // of natural coordinates

/// Newton's method for X(xi) = point. @return false where it does not come to rest
bool natural_coordinates(ElementType type, const std::vector<double>& x, const Vec3& point, std::array<double, 3>& xi) {
  const auto nodes = at(shape_of(type).nodes);
  xi = middle_of(type);
  for (int pass = 0; pass < 30; ++pass) {
    double n[kMaxElementNodes], dn[3 * kMaxElementNodes];
    shape_values(type, xi.data(), n);
    shape_gradients(type, xi.data(), dn);
    Vec3 rest = point;
    Mat3 jacobian = Mat3::Zero();
    for (std::size_t a = 0; a < nodes; ++a) {
      const Eigen::Map<const Vec3> node(&x[3 * a]);
      rest -= n[a] * node;
      for (std::size_t d = 0; d < 3; ++d) jacobian.col(static_cast<int>(d)) += dn[d * nodes + a] * node;
    }
    const Vec3 step = jacobian.partialPivLu().solve(rest);
    if (!step.allFinite()) return false;
    for (int i = 0; i < 3; ++i) xi[at(i)] += step[i];
    if (step.norm() > 10) return false;
    if (step.norm() < 1e-13) return true;
  }
  return true;
}

bool is_inside(ElementType type, const std::array<double, 3>& xi) {
  if (shape_of(type).corners == 4)
    return std::min({xi[0], xi[1], xi[2]}) >= -kInside && xi[0] + xi[1] + xi[2] <= 1 + kInside;
  if (shape_of(type).corners == 6)
    return std::min(xi[0], xi[1]) >= -kInside && xi[0] + xi[1] <= 1 + kInside && std::abs(xi[2]) <= 1 + kInside;
  return std::max({std::abs(xi[0]), std::abs(xi[1]), std::abs(xi[2])}) <= 1 + kInside;
}

/// Whether a box around the nodes, half as large again, has the point in it.
bool may_hold(const std::vector<double>& x, const Vec3& point) {
  const Eigen::Map<const Eigen::Matrix3Xd> nodes(x.data(), 3, static_cast<Eigen::Index>(x.size() / 3));
  const Vec3 low = nodes.rowwise().minCoeff(), high = nodes.rowwise().maxCoeff();
  const Vec3 margin = Vec3::Constant(0.25 * (high - low).maxCoeff());
  return ((point - low + margin).array() >= 0).all() && ((high + margin - point).array() >= 0).all();
}

/// The axis of a beam or cable element in its reference state.
class ElementAxis {
 public:
  ElementAxis(const SampledBody& body, Index e) : x_(body.reference(e)), step_(x_.size() / 6) {
    length_ = (vertex(step_) - vertex(0)).norm();
  }
  [[nodiscard]] Vec3 place(double xi) const { return combine(xi, 0); }
  [[nodiscard]] Vec3 slope(double xi) const { return combine(xi, 1); }
  /// The section's y or z.
  [[nodiscard]] Vec3 direction(double xi, std::size_t which) const {
    return (0.5 * (1 - xi) * vertex(1 + which) + 0.5 * (1 + xi) * vertex(step_ + 1 + which)).normalized();
  }
  [[nodiscard]] bool has_section() const { return step_ == 4; }
  /// xi of the point of the (endless) axis with `point` in its section.
  [[nodiscard]] double nearest(const Vec3& point) const {
    double xi = 0;
    for (int pass = 0; pass < 50; ++pass) {
      const Vec3 along = slope(xi);
      const double step = 2 / length_ * along.dot(point - place(xi)) / along.squaredNorm();
      xi = std::clamp(xi + step, -3.0, 3.0);
      if (std::abs(step) < 1e-13) break;
    }
    return xi;
  }

 private:
  [[nodiscard]] Vec3 vertex(std::size_t k) const { return Eigen::Map<const Vec3>(&x_[3 * k]); }
  // Hermite's cubics with the slopes of the nodes, or their derivatives by length.
  [[nodiscard]] Vec3 combine(double xi, int derivative) const {
    const double s = 0.5 * (1 + xi), l = length_;
    const Vec3 a = vertex(0), b = vertex(step_), ta = l * vertex(1), tb = l * vertex(step_ + 1);
    if (derivative == 0)
      return (1 - 3 * s * s + 2 * s * s * s) * a + (s - 2 * s * s + s * s * s) * ta + (3 * s * s - 2 * s * s * s) * b +
             (s * s * s - s * s) * tb;
    return ((6 * s * s - 6 * s) * (a - b) + (1 - 4 * s + 3 * s * s) * ta + (3 * s * s - 2 * s) * tb) / l;
  }

  std::vector<double> x_;
  std::size_t step_;
  double length_;
};

std::vector<Located> locate_on_line(const SampledBody& body, const Vec3& point) {
  std::vector<Located> found;
  double least = std::numeric_limits<double>::infinity();
  for (Index e = 0; e < body.elements(); ++e) {
    const ElementAxis axis(body, e);
    const double xi = axis.nearest(point);
    if (std::abs(xi) > 1 + kInside) continue;
    const Vec3 arm = point - axis.place(xi);
    const double distance = arm.norm(), same = kInside * body.body().flexible->size();
    if (distance > least + same) continue;
    if (distance < least - same) found.clear();
    least = std::min(least, distance);
    Located here{e, {xi, 0, 0}};
    if (axis.has_section()) {
      here.y = arm.dot(axis.direction(xi, 1));
      here.z = arm.dot(axis.direction(xi, 2));
    }
    found.push_back(here);
  }
  return found;
}

}  // namespace

std::vector<Located> locate(const SampledBody& body, const Vec3& point) {
  std::vector<Located> found;
  if (body.kind() == FieldBody::beam || body.kind() == FieldBody::cable) {
    found = locate_on_line(body, point);
  } else {
    for (Index e = 0; e < body.elements(); ++e) {
      const std::vector<double> x = body.reference(e);
      std::array<double, 3> xi{};
      if (may_hold(x, point) && natural_coordinates(body.shape(e), x, point, xi) && is_inside(body.shape(e), xi))
        found.push_back({e, xi});
    }
  }
  if (!found.empty()) return found;
  Vec3 low = body.node_place(0), high = low;
  for (Index k = 0; k < body.nodes(); ++k) {
    low = low.cwiseMin(body.node_place(k));
    high = high.cwiseMax(body.node_place(k));
  }
  throw std::invalid_argument(fmt::format(
      "no element of '{}' has the point ({:g} {:g} {:g}) in it; its nodes lie between ({:g} {:g} {:g}) and ({:g} {:g} "
      "{:g}), in the coordinates of the mesh, without 'position' and 'rotation' of the body",
      body.body().spec.name, point[0], point[1], point[2], low[0], low[1], low[2], high[0], high[1], high[2]));
}

}  // namespace espalier::dynamics::model
