#include "dynamics/joints/space_spline.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::dynamics {
namespace {

struct Row {
  double below = 0, diagonal = 0, above = 0;
  Vec3 right = Vec3::Zero();
};

/// Gauss without pivots: the rows are dominated by their diagonals.
std::vector<Vec3> solve_tridiagonal(std::vector<Row> rows) {
  const std::size_t n = rows.size();
  for (std::size_t i = 1; i < n; ++i) {
    const double factor = rows[i].below / rows[i - 1].diagonal;
    rows[i].diagonal -= factor * rows[i - 1].above;
    rows[i].right -= factor * rows[i - 1].right;
  }
  std::vector<Vec3> x(n);
  for (std::size_t i = n; i-- > 0;)
    x[i] = (rows[i].right - (i + 1 < n ? Vec3(rows[i].above * x[i + 1]) : Vec3(Vec3::Zero()))) / rows[i].diagonal;
  return x;
}

/// The equation of knot i: h0 M_{i-1} + 2 (h0 + h1) M_i + h1 M_{i+1} = 6 (rise of slope).
Row row_of(double h0, double h1, const Vec3& before, const Vec3& here, const Vec3& after) {
  return {h0, 2 * (h0 + h1), h1, 6 * ((after - here) / h1 - (here - before) / h0)};
}

/// Cyclic: the corners by the formula of Sherman and Morrison (Numerical Recipes, section 2.7).
std::vector<Vec3> periodic_bends(const std::vector<double>& x, const std::vector<Vec3>& y, double period) {
  const std::size_t n = y.size();
  const auto step = [&](std::size_t i) { return i + 1 < n ? x[i + 1] - x[i] : x[0] + period - x[i]; };
  std::vector<Row> rows;
  for (std::size_t i = 0; i < n; ++i)
    rows.push_back(row_of(step((i + n - 1) % n), step(i), y[(i + n - 1) % n], y[i], y[(i + 1) % n]));
  const double top = rows.front().below, bottom = rows.back().above, gamma = -rows.front().diagonal;
  rows.front().diagonal -= gamma;
  rows.back().diagonal -= top * bottom / gamma;
  std::vector<Row> corner = rows;
  for (Row& r : corner) r.right.setZero();
  corner.front().right.setConstant(gamma);
  corner.back().right.setConstant(bottom);
  std::vector<Vec3> m = solve_tridiagonal(std::move(rows));
  const std::vector<Vec3> z = solve_tridiagonal(std::move(corner));
  const Vec3 share = (m.front() + top / gamma * m.back()) / (1 + z.front()[0] + top / gamma * z.back()[0]);
  for (std::size_t i = 0; i < n; ++i) m[i] -= z[i][0] * share;
  return m;
}

}  // namespace

std::vector<Vec3> spline_bends(const std::vector<double>& x, const std::vector<Vec3>& y, double period) {
  const std::size_t n = y.size();
  if (period > 0) return periodic_bends(x, y, period);
  if (n < 3) return std::vector<Vec3>(n, Vec3::Zero());
  const auto step = [&](std::size_t i) { return x[i + 1] - x[i]; };
  if (n == 3) {
    const Row r = row_of(step(0), step(1), y[0], y[1], y[2]);
    return std::vector<Vec3>(3, r.right / (3 * (step(0) + step(1))));
  }
  std::vector<Row> rows;
  for (std::size_t i = 1; i + 1 < n; ++i) rows.push_back(row_of(step(i - 1), step(i), y[i - 1], y[i], y[i + 1]));
  // Not a knot: M_0 = (1 + r) M_1 - r M_2 with r = h_0 / h_1, and so from the other end.
  const double first = step(0) / step(1), last = step(n - 2) / step(n - 3);
  rows.front().diagonal += step(0) * (1 + first);
  rows.front().above -= step(0) * first;
  rows.back().diagonal += step(n - 2) * (1 + last);
  rows.back().below -= step(n - 2) * last;
  const std::vector<Vec3> inner = solve_tridiagonal(std::move(rows));
  std::vector<Vec3> m = {(1 + first) * inner[0] - first * inner[1]};
  m.insert(m.end(), inner.begin(), inner.end());
  m.push_back((1 + last) * inner[n - 3] - last * inner[n - 4]);
  return m;
}

SpaceSpline::SpaceSpline(std::vector<double> knots, std::vector<Vec3> values, bool closed)
    : closed_(closed), knots_(std::move(knots)), values_(std::move(values)) {
  bends_ = spline_bends(knots_, values_, closed ? knots_.back() - knots_.front() : 0);
  if (!closed) return;
  values_.push_back(Vec3(values_.front()));
  bends_.push_back(Vec3(bends_.front()));
}

double SpaceSpline::wrapped(double u) const {
  const double period = most() - least();
  return u - period * std::floor((u - least()) / period);
}

SplinePoint SpaceSpline::at(double u) const {
  const double inside = closed_ ? wrapped(u) : std::clamp(u, least(), most());
  const auto after = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, inside);
  const auto i = static_cast<std::size_t>(after - knots_.begin()) - 1;
  const double h = knots_[i + 1] - knots_[i], b = (inside - knots_[i]) / h, a = 1 - b;
  const Vec3 &y0 = values_[i], &y1 = values_[i + 1], &m0 = bends_[i], &m1 = bends_[i + 1];
  SplinePoint p;
  p.x = a * y0 + b * y1 + h * h / 6 * (a * (a * a - 1) * m0 + b * (b * b - 1) * m1);
  p.d1 = (y1 - y0) / h + h / 6 * ((3 * b * b - 1) * m1 - (3 * a * a - 1) * m0);
  if (!closed_ && inside != u) {
    p.x += (u - inside) * p.d1;
    return p;
  }
  p.d2 = a * m0 + b * m1;
  p.d3 = (m1 - m0) / h;
  return p;
}

}  // namespace espalier::dynamics
