#include "dynamics/bodies/beam_axis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/elements/line_point.hpp"

namespace espalier::dynamics {
namespace {

Mat3 first_axes(const Vec3& along, const Vec3& y_direction) {
  const Vec3 x = along.normalized(), z = x.cross(y_direction);
  if (!(along.norm() > 0)) throw std::invalid_argument("the axis of the beam has no direction at its start");
  if (!(z.norm() > 1e-12 * y_direction.norm()))
    throw std::invalid_argument("the section's y direction lies along the axis");
  Mat3 axes;
  axes << x, z.normalized().cross(x), z.normalized();
  return axes;
}

/// Constant curvature k: R(s) = R(0) exp(s k), r(s) = r(0) + R(0) (integral of exp(t k) dt) e_x; the integral is that
/// of tangent_times() with the other sign.
BeamAxis arc(const ArcAxis& shape, const Vec3& y_direction, Index elements) {
  if (!(shape.length > 0)) throw std::invalid_argument(fmt::format("its length {} is not positive", shape.length));
  const Mat3 first = first_axes(shape.direction, y_direction);
  BeamAxis axis{{}, shape.length / elements};
  for (Index k = 0; k <= elements; ++k) {
    const double s = shape.length * k / elements;
    const Vec3 turn = s * shape.curvature;
    axis.nodes.push_back({shape.start + first * (s * tangent_times(-turn, Vec3::UnitX())), first * rotation_exp(turn)});
  }
  return axis;
}

/// A cubic spline by the sum of the chords.
class Spline {
 public:
  explicit Spline(const std::vector<Vec3>& points) : points_(points), knots_(1, 0.0) {
    if (points.size() < 2) throw std::invalid_argument("an axis needs two points at least");
    for (std::size_t k = 1; k < points.size(); ++k) {
      const double chord = (points[k] - points[k - 1]).norm();
      if (!(chord > 0)) throw std::invalid_argument(fmt::format("points {} and {} of the axis coincide", k, k + 1));
      knots_.push_back(knots_.back() + chord);
    }
    second_ = second_derivatives();
  }
  [[nodiscard]] const std::vector<double>& knots() const { return knots_; }
  [[nodiscard]] Vec3 value(double t) const { return at(t, 0); }
  [[nodiscard]] Vec3 slope(double t) const { return at(t, 1); }

 private:
  [[nodiscard]] double step(std::size_t k) const { return knots_[k + 1] - knots_[k]; }

  /// h_(k-1) m_(k-1) + 2 (h_(k-1) + h_k) m_k + h_k m_(k+1) = 6 (difference of the chords' slopes); at the ends the
  /// third derivative is the same on both sides of the second and of the last but one point, which gives m
  /// there; with it the first and the last of these equations have two unknowns. Elimination from the first to the
  /// last: the diagonal is the largest of its row.
  [[nodiscard]] Eigen::MatrixX3d second_derivatives() const {
    const std::size_t n = points_.size();
    Eigen::MatrixX3d m = Eigen::MatrixX3d::Zero(static_cast<Eigen::Index>(n), 3);
    std::vector<double> above(n, 0.0);  // of the unit diagonal
    for (std::size_t k = 1; k + 1 < n; ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      const double a = step(k - 1), b = step(k);
      double before = k == 1 ? 0 : a, diagonal = 2 * (a + b), after = k + 2 == n ? 0 : b;
      if (n == 3) diagonal += a + b;  // all three are the same: a parabola
      if (n > 3 && k == 1) diagonal += a * (a + b) / b, after -= a * a / b;
      if (n > 3 && k + 2 == n) diagonal += b * (a + b) / a, before -= b * b / a;
      m.row(row) = 6 * ((points_[k + 1] - points_[k]) / b - (points_[k] - points_[k - 1]) / a).transpose();
      m.row(row) -= before * m.row(row - 1);
      diagonal -= before * above[k - 1];
      above[k] = after / diagonal;
      m.row(row) /= diagonal;
    }
    for (auto row = static_cast<Eigen::Index>(n) - 2; row > 0; --row)
      m.row(row) -= above[static_cast<std::size_t>(row)] * m.row(row + 1);
    if (n < 3) return m;
    const auto last = static_cast<Eigen::Index>(n) - 1;
    m.row(0) = m.row(1);
    m.row(last) = m.row(last - 1);
    if (n == 3) return m;
    m.row(0) += step(0) / step(1) * (m.row(1) - m.row(2));
    m.row(last) += step(n - 2) / step(n - 3) * (m.row(last - 1) - m.row(last - 2));
    return m;
  }

  [[nodiscard]] Vec3 at(double t, int derivative) const {
    const auto above = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, t);
    const auto k = static_cast<std::size_t>(above - knots_.begin()) - 1;
    const auto row = static_cast<Eigen::Index>(k);
    const double h = step(k), b = (t - knots_[k]) / h, a = 1 - b;
    const Vec3 left = second_.row(row).transpose(), right = second_.row(row + 1).transpose();
    if (derivative == 0)
      return a * points_[k] + b * points_[k + 1] + h * h / 6 * ((a * a * a - a) * left + (b * b * b - b) * right);
    return (points_[k + 1] - points_[k]) / h + h / 6 * ((1 - 3 * a * a) * left + (3 * b * b - 1) * right);
  }

  std::vector<Vec3> points_;
  std::vector<double> knots_;
  Eigen::MatrixX3d second_;
};

/// Arc length between two parameters within one piece.
double length_between(const Spline& spline, double from, double to) {
  double sum = 0;
  for (const LinePoint& point : kGauss5)
    sum += 0.5 * (to - from) * point.weight * spline.slope(0.5 * (from + to + point.xi * (to - from))).norm();
  return sum;
}

/// Parameters of `count` + 1 points at equal distances along the spline.
std::vector<double> equal_parameters(const Spline& spline, std::size_t count, double& total) {
  constexpr int kParts = 8;  // of a piece of the spline: its length is then exact to round-off but for wild points
  std::vector<double> t(1, 0.0), s(1, 0.0);
  for (std::size_t k = 0; k + 1 < spline.knots().size(); ++k)
    for (int part = 1; part <= kParts; ++part) {
      const double a = spline.knots()[k], b = spline.knots()[k + 1], next = a + (b - a) * part / kParts;
      s.push_back(s.back() + length_between(spline, t.back(), next));
      t.push_back(next);
    }
  total = s.back();
  std::vector<double> result;
  for (std::size_t k = 0; k <= count; ++k) {
    const double wanted = total * static_cast<double>(k) / static_cast<double>(count);
    const auto above = std::upper_bound(s.begin() + 1, s.end() - 1, wanted) - s.begin();
    const auto i = static_cast<std::size_t>(above) - 1;
    double at = t[i] + (t[i + 1] - t[i]) * (wanted - s[i]) / (s[i + 1] - s[i]);
    for (int pass = 0; pass < 5; ++pass)  // Newton's method from a good guess
      at -= (s[i] + length_between(spline, t[i], at) - wanted) / spline.slope(at).norm();
    result.push_back(at);
  }
  return result;
}

/// The next axes without twist, by reflection in two planes (Wang, Juettler, Zheng and Liu 2008, "Computation of
/// rotation minimizing frames"); error of the fourth order in the step.
Mat3 transported(const AxisNode& from, const Vec3& position, const Vec3& x) {
  const auto reflected = [](const Vec3& a, const Vec3& n) { return Vec3(a - 2 / n.squaredNorm() * n.dot(a) * n); };
  const Vec3 chord = position - from.position;
  const Vec3 mirrored = reflected(from.axes.col(0), chord), difference = x - mirrored;
  Vec3 y = reflected(from.axes.col(1), chord);
  if (difference.norm() > 0) y = reflected(y, difference);
  Mat3 axes;
  const Vec3 z = x.cross(y).normalized();
  axes << x, z.cross(x), z;
  return axes;
}

BeamAxis through(const SplineAxis& shape, const Vec3& y_direction, Index elements) {
  constexpr std::size_t kSubsteps = 16;
  const Spline spline(shape.points);
  BeamAxis axis;
  double length = 0;
  const std::vector<double> t = equal_parameters(spline, kSubsteps * static_cast<std::size_t>(elements), length);
  axis.element_length = length / elements;
  AxisNode node{spline.value(0), first_axes(spline.slope(0), y_direction)};
  axis.nodes.push_back(node);
  for (std::size_t k = 1; k < t.size(); ++k) {
    const Vec3 next = spline.value(t[k]);
    node = {next, transported(node, next, spline.slope(t[k]).normalized())};
    if (k % kSubsteps == 0) axis.nodes.push_back(node);
  }
  return axis;
}

}  // namespace

BeamAxis make_beam_axis(const AxisShape& shape, const Vec3& y_direction, Index elements) {
  if (elements < 1) throw std::invalid_argument("a beam needs one element at least");
  if (const auto* straight = std::get_if<StraightAxis>(&shape)) {
    const Vec3 along = straight->end - straight->start;
    if (!(along.norm() > 0)) throw std::invalid_argument("the ends of the beam coincide");
    return arc({straight->start, along, along.norm(), Vec3::Zero()}, y_direction, elements);
  }
  if (const auto* curved = std::get_if<ArcAxis>(&shape)) return arc(*curved, y_direction, elements);
  return through(std::get<SplineAxis>(shape), y_direction, elements);
}

}  // namespace espalier::dynamics
