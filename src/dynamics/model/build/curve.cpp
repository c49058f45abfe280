#include "dynamics/model/build/curve.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "espalier/types.hpp"

namespace espalier::dynamics::model {

Curve::Curve(std::string name, std::vector<double> x, std::vector<double> y, Kind kind, Outside outside)
    : name_(std::move(name)), x_(std::move(x)), y_(std::move(y)), outside_(outside) {
  if (x_.size() != y_.size() || x_.size() < 2) throw std::invalid_argument("a curve needs at least two points");
  for (std::size_t i = 0; i < x_.size(); ++i) {
    if (!std::isfinite(x_[i]) || !std::isfinite(y_[i]))
      throw std::invalid_argument(fmt::format("point {} ({}, {}) is not finite", i + 1, x_[i], y_[i]));
    if (i > 0 && !(x_[i] > x_[i - 1]))
      throw std::invalid_argument(
          fmt::format("x must increase from point to point, but point {} has {} after {}", i + 1, x_[i], x_[i - 1]));
  }
  find_corners(kind == Kind::linear ? 1e-3 : 0.3);
  if (kind == Kind::linear) return;
  slope_.assign(x_.size(), secant(0));
  if (x_.size() == 2) return;
  if (kind == Kind::akima) akima_slopes();
  if (kind == Kind::monotone) monotone_slopes();
  if (kind == Kind::cubic) natural_slopes();
}

void Curve::find_corners(double sharp) {
  const auto [least, most] = std::minmax_element(y_.begin(), y_.end());
  const std::size_t n = x_.size();
  const bool flat = outside_ == Outside::constant;
  for (std::size_t i = 0; i < n; ++i) {
    const bool first = i == 0, last = i + 1 == n;
    if ((first || last) && !flat) continue;
    const double before = first ? 0 : secant(i - 1), after = last ? 0 : secant(i);
    const double width = first  ? x_[1] - x_[0]
                         : last ? x_[i] - x_[i - 1]
                                : std::min(x_[i] - x_[i - 1], x_[i + 1] - x_[i]);
    if (std::abs(after - before) * width > sharp * (*most - *least)) corners_.push_back(x_[i]);
  }
}

double Curve::level(double x) const {
  const double width = x_.back() - x_.front();
  const auto behind = std::upper_bound(corners_.begin(), corners_.end(), x);
  const auto k = static_cast<double>(behind - corners_.begin());
  if (behind == corners_.begin()) return std::max(-0.5, (x - corners_.front()) / width);
  const double corner = *(behind - 1);
  if (behind == corners_.end()) return k - 1 + std::min(0.5, (x - corner) / width);
  return k - 1 + (x - corner) / (*behind - corner);
}

// With m_i the secants and two more on either side by extrapolation, m_{-1} = 2 m_0 - m_1 ...: the slope at point i is
// the mean of m_{i-1} and m_i weighted by |m_{i+1} - m_i| and |m_{i-1} - m_{i-2}|; of equal halves where both vanish.
void Curve::akima_slopes() {
  const std::size_t n = x_.size();
  std::vector<double> m(n + 3);
  for (std::size_t i = 0; i + 1 < n; ++i) m[i + 2] = secant(i);
  m[1] = 2 * m[2] - m[3];
  m[0] = 2 * m[1] - m[2];
  m[n + 1] = 2 * m[n] - m[n - 1];
  m[n + 2] = 2 * m[n + 1] - m[n];
  for (std::size_t i = 0; i < n; ++i) {
    const double right = std::abs(m[i + 3] - m[i + 2]), left = std::abs(m[i + 1] - m[i]);
    const double size = std::abs(m[i + 3]) + std::abs(m[i + 2]) + std::abs(m[i + 1]) + std::abs(m[i]);
    slope_[i] = left + right > 1e-14 * size ? (right * m[i + 1] + left * m[i + 2]) / (left + right)
                                            : 0.5 * (m[i + 1] + m[i + 2]);
  }
}

// Weighted harmonic mean of the secants where both have one sign, else 0; ends: one-sided, at most three secants steep.
void Curve::monotone_slopes() {
  const std::size_t n = x_.size();
  const auto width = [&](std::size_t i) { return x_[i + 1] - x_[i]; };
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double a = secant(i - 1), b = secant(i);
    const double wa = 2 * width(i) + width(i - 1), wb = width(i) + 2 * width(i - 1);
    slope_[i] = a * b > 0 ? (wa + wb) / (wa / a + wb / b) : 0.0;
  }
  const auto end = [&](double near, double far, double h, double next) {
    const double s = ((2 * h + next) * near - h * far) / (h + next);
    if (s * near <= 0) return 0.0;
    return near * far <= 0 && std::abs(s) > 3 * std::abs(near) ? 3 * near : s;
  };
  slope_.front() = end(secant(0), secant(1), width(0), width(1));
  slope_.back() = end(secant(n - 2), secant(n - 3), width(n - 2), width(n - 3));
}

// Tridiagonal equations for the slopes: continuous second derivatives inside, zero at the ends.
void Curve::natural_slopes() {
  const std::size_t n = x_.size();
  std::vector<double> diagonal(n), upper(n), right(n);
  diagonal[0] = 2, upper[0] = 1, right[0] = 3 * secant(0);
  for (std::size_t i = 1; i < n; ++i) {
    double lower = 1;
    if (i + 1 < n) {
      lower = 1 / (x_[i] - x_[i - 1]);
      upper[i] = 1 / (x_[i + 1] - x_[i]);
      diagonal[i] = 2 * (lower + upper[i]);
      right[i] = 3 * (secant(i - 1) * lower + secant(i) * upper[i]);
    } else {
      diagonal[i] = 2, right[i] = 3 * secant(i - 1);
    }
    const double factor = lower / diagonal[i - 1];
    diagonal[i] -= factor * upper[i - 1];
    right[i] -= factor * right[i - 1];
  }
  slope_[n - 1] = right[n - 1] / diagonal[n - 1];
  for (std::size_t i = n - 1; i-- > 0;) slope_[i] = (right[i] - upper[i] * slope_[i + 1]) / diagonal[i];
}

CurvePoint Curve::inside(double x) const {
  const auto next = std::upper_bound(x_.begin() + 1, x_.end() - 1, x);
  const auto i = static_cast<std::size_t>(next - x_.begin()) - 1;
  const double h = x_[i + 1] - x_[i], d = x - x_[i], m = secant(i);
  if (slope_.empty()) return {y_[i] + m * d, m, 0};
  // y + s0 d + c d^2 + e d^3 through both ends with their slopes
  const double s0 = slope_[i], s1 = slope_[i + 1];
  const double c = (3 * m - 2 * s0 - s1) / h, e = (s0 + s1 - 2 * m) / (h * h);
  return {y_[i] + d * (s0 + d * (c + d * e)), s0 + d * (2 * c + 3 * d * e), 2 * c + 6 * d * e};
}

CurvePoint Curve::at(double x) const {
  const double end = std::clamp(x, x_.front(), x_.back());
  if (end == x) return inside(x);
  if (outside_ == Outside::error || !std::isfinite(x))
    throw Error(
        StatusCode::invalid_input,
        fmt::format("the spline '{}' is asked for x = {:g}, but it is given from {:g} to {:g} only; add points, "
                    "or choose outside = \"constant\" or \"linear\"",
                    name_, x, x_.front(), x_.back()));
  CurvePoint p = inside(end);
  p.bend = 0;
  if (outside_ == Outside::constant) return {p.y, 0, 0};
  return {p.y + p.slope * (x - end), p.slope, 0};
}

}  // namespace espalier::dynamics::model
