#include "dynamics/joints/surface_shape.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/joints/rows.hpp"
#include "dynamics/joints/space_spline.hpp"

namespace espalier::dynamics {
namespace {

/// Length of D p, D a diagonal matrix of zeros and ones, less `size`.
PointFunction::At length_of(const Vec3& p, const Vec3& diagonal, double size, const char* middle) {
  const Vec3 part = diagonal.cwiseProduct(p);
  const double length = part.norm();
  if (!(length > 1e-12 * size))
    throw Error(StatusCode::singular,
                std::string("a point stands ") + middle +
                    ", from where no direction leads to the surface; it begins on the surface or near it");
  const Vec3 u = part / length;
  return {length - size, u, (Mat3(diagonal.asDiagonal()) - u * u.transpose()) / length};
}

class Plane final : public PointFunction {
 public:
  [[nodiscard]] At at(const Vec3& p) const override { return {p.z(), Vec3::UnitZ(), Mat3::Zero()}; }
};

class Sphere final : public PointFunction {
 public:
  explicit Sphere(double radius) : radius_(radius) {}
  [[nodiscard]] At at(const Vec3& p) const override {
    return length_of(p, Vec3::Ones(), radius_, "in the middle of a sphere");
  }

 private:
  double radius_;
};

class Cylinder final : public PointFunction {
 public:
  explicit Cylinder(double radius) : radius_(radius) {}
  [[nodiscard]] At at(const Vec3& p) const override {
    return length_of(p, Vec3(1, 1, 0), radius_, "on the axis of a cylinder");
  }

 private:
  double radius_;
};

/// s (|p / axes| - 1), s the least axis.
class Ellipsoid final : public PointFunction {
 public:
  explicit Ellipsoid(const Vec3& axes) : inverse_(axes.cwiseInverse()), size_(axes.minCoeff()) {}
  [[nodiscard]] At at(const Vec3& p) const override {
    const At unit = length_of(inverse_.cwiseProduct(p), Vec3::Ones(), 1, "in the middle of an ellipsoid");
    return {size_ * unit.value, size_ * inverse_.cwiseProduct(unit.gradient),
            size_ * inverse_.asDiagonal() * unit.hessian * inverse_.asDiagonal()};
  }

 private:
  Vec3 inverse_;
  double size_;
};

/// rho cos - z sin
class Cone final : public PointFunction {
 public:
  explicit Cone(double angle) : cosine_(std::cos(angle)), sine_(std::sin(angle)) {}
  [[nodiscard]] At at(const Vec3& p) const override {
    const At rho = length_of(p, Vec3(1, 1, 0), std::abs(p.z()), "on the axis of a cone");
    return {cosine_ * (rho.value + std::abs(p.z())) - sine_ * p.z(), cosine_ * rho.gradient - sine_ * Vec3::UnitZ(),
            cosine_ * rho.hessian};
  }

 private:
  double cosine_, sine_;
};

/// sqrt((rho - R)^2 + z^2) - r
class Torus final : public PointFunction {
 public:
  Torus(double radius, double rim) : radius_(radius), rim_(rim) {}
  [[nodiscard]] At at(const Vec3& p) const override {
    const At rho = length_of(p, Vec3(1, 1, 0), radius_, "on the axis of a torus");
    const At tube = length_of({rho.value, 0, p.z()}, Vec3(1, 0, 1), rim_, "in the middle of the tube of a torus");
    Mat3 inner = Mat3::Zero();  // derivative of (rho - R, 0, z) by p
    inner.row(0) = rho.gradient.transpose();
    inner(2, 2) = 1;
    return {tube.value, inner.transpose() * tube.gradient,
            inner.transpose() * tube.hessian * inner + tube.gradient[0] * rho.hessian};
  }

 private:
  double radius_, rim_;
};

/// What a cubic spline multiplies at a place: y_i, y_{i+1} and their second derivatives; with two derivatives.
struct SplineShares {
  std::size_t i = 0;
  std::array<std::array<double, 4>, 3> of{};
};

SplineShares shares_at(const std::vector<double>& knots, double u) {
  const double inside = std::clamp(u, knots.front(), knots.back());
  SplineShares s;
  s.i = static_cast<std::size_t>(std::upper_bound(knots.begin() + 1, knots.end() - 1, inside) - knots.begin()) - 1;
  const double h = knots[s.i + 1] - knots[s.i], b = (inside - knots[s.i]) / h, a = 1 - b;
  s.of[0] = {a, b, h * h / 6 * a * (a * a - 1), h * h / 6 * b * (b * b - 1)};
  s.of[1] = {-1 / h, 1 / h, -h / 6 * (3 * a * a - 1), h / 6 * (3 * b * b - 1)};
  if (inside == u) {
    s.of[2] = {0, 0, a, b};
  } else {
    for (std::size_t k = 0; k < 4; ++k) s.of[0][k] += (u - inside) * s.of[1][k];
  }
  return s;
}

using Grid = std::vector<std::vector<double>>;

/// Second derivatives along the second index.
Grid bends_along(const std::vector<double>& knots, const Grid& values) {
  Grid bends;
  for (const std::vector<double>& line : values) {
    std::vector<Vec3> y;
    for (const double v : line) y.emplace_back(v, 0, 0);
    bends.emplace_back();
    for (const Vec3& m : spline_bends(knots, y, 0)) bends.back().push_back(m.x());
  }
  return bends;
}

Grid turned(const Grid& values) {
  Grid result(values.front().size(), std::vector<double>(values.size()));
  for (std::size_t i = 0; i < values.size(); ++i)
    for (std::size_t j = 0; j < values[i].size(); ++j) result[j][i] = values[i][j];
  return result;
}

/// z - f(x, y)
class Height final : public PointFunction {
 public:
  Height(std::vector<double> x, std::vector<double> y, Grid heights) : x_(std::move(x)), y_(std::move(y)) {
    Grid by_y = bends_along(y_, heights);
    of_[1][0] = turned(bends_along(x_, turned(heights)));
    of_[1][1] = turned(bends_along(x_, turned(by_y)));
    of_[0][0] = std::move(heights);
    of_[0][1] = std::move(by_y);
  }
  [[nodiscard]] At at(const Vec3& p) const override {
    const SplineShares sx = shares_at(x_, p.x()), sy = shares_at(y_, p.y());
    At result;
    result.value = p.z() - sum(sx, sy, 0, 0);
    result.gradient = {-sum(sx, sy, 1, 0), -sum(sx, sy, 0, 1), 1};
    const double mixed = -sum(sx, sy, 1, 1);
    result.hessian << -sum(sx, sy, 2, 0), mixed, 0, mixed, -sum(sx, sy, 0, 2), 0, 0, 0, 0;
    return result;
  }

 private:
  [[nodiscard]] double sum(const SplineShares& sx, const SplineShares& sy, std::size_t dx, std::size_t dy) const {
    double result = 0;
    for (std::size_t k = 0; k < 4; ++k)
      for (std::size_t l = 0; l < 4; ++l)
        result += sx.of[dx][k] * sy.of[dy][l] * of_[k / 2][l / 2][sx.i + k % 2][sy.i + l % 2];
    return result;
  }

  std::vector<double> x_, y_;
  Grid of_[2][2];  // values at the points; second derivatives by x (first index 1) and by y (second index 1)
};

}  // namespace

SurfacePtr plane_surface() { return std::make_shared<Plane>(); }
SurfacePtr sphere_surface(double radius) { return std::make_shared<Sphere>(radius); }
SurfacePtr ellipsoid_surface(const Vec3& axes) { return std::make_shared<Ellipsoid>(axes); }
SurfacePtr cylinder_surface(double radius) { return std::make_shared<Cylinder>(radius); }
SurfacePtr cone_surface(double angle) { return std::make_shared<Cone>(angle); }
SurfacePtr torus_surface(double radius, double rim) { return std::make_shared<Torus>(radius, rim); }
SurfacePtr height_surface(std::vector<double> x, std::vector<double> y, std::vector<std::vector<double>> heights) {
  return std::make_shared<Height>(std::move(x), std::move(y), std::move(heights));
}

std::unique_ptr<Joint> point_on_surface(std::string name, FramePtr a, FramePtr b, SurfacePtr surface) {
  using namespace joint_rows;
  JointRow::Term term;
  term.function = std::move(surface);
  return make("point on surface", std::move(name), std::move(a), std::move(b),
              {row("height above the surface", std::move(term))});
}

}  // namespace espalier::dynamics
