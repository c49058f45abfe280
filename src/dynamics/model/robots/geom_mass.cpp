#include "dynamics/model/robots/geom_mass.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dense/dense.hpp"
#include "dynamics/contact/geometry/surface_file.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {
namespace {

constexpr double kPi = std::numbers::pi;

Mass solid_mass(const Geom& g) {
  const Vec3 s = g.size;
  Mass m;
  Vec3 inertia = Vec3::Zero();  // at mass 1
  switch (g.kind) {
    case GeomKind::sphere:
      m.mass = 4 * kPi / 3 * s[0] * s[0] * s[0];
      inertia.setConstant(0.4 * s[0] * s[0]);
      break;
    case GeomKind::ellipsoid:
      m.mass = 4 * kPi / 3 * s[0] * s[1] * s[2];
      inertia = Vec3(s[1] * s[1] + s[2] * s[2], s[0] * s[0] + s[2] * s[2], s[0] * s[0] + s[1] * s[1]) / 5;
      break;
    case GeomKind::box:
      m.mass = 8 * s[0] * s[1] * s[2];
      inertia = Vec3(s[1] * s[1] + s[2] * s[2], s[0] * s[0] + s[2] * s[2], s[0] * s[0] + s[1] * s[1]) / 3;
      break;
    case GeomKind::cylinder: {
      const double h = 2 * s[1];
      m.mass = kPi * s[0] * s[0] * h;
      inertia = Vec3(3 * s[0] * s[0] + h * h, 3 * s[0] * s[0] + h * h, 6 * s[0] * s[0]) / 12;
      break;
    }
    case GeomKind::capsule: {  // a cylinder and two half balls, whose centres are 3/8 r beyond its ends
      const double r = s[0], h = 2 * s[1], ball = 4 * r / (4 * r + 3 * h), middle = 1 - ball;
      m.mass = kPi * r * r * (h + 4 * r / 3);
      const double across = middle * (3 * r * r + h * h) / 12 + ball * (0.4 * r * r + h * h / 4 + 3 * h * r / 8);
      inertia = Vec3(across, across, middle * r * r / 2 + ball * 0.4 * r * r);
      break;
    }
    default:
      break;
  }
  m.inertia = (m.mass * inertia).asDiagonal();
  return m;
}

/// A hollow primitive: how its volume and inertia grow with its surface. They are polynomials of degree 5 at most,
/// whose derivative these differences are. An ellipsoid that grows so gets a skin of uneven thickness; as in MuJoCo its
/// inertia is that, and its area that of Thomsen's formula (to 1 %).
Mass shell_mass(const Geom& g) {
  double least = g.size.maxCoeff();
  for (const double s : g.size)
    if (s > 0) least = std::min(least, s);
  const double t = 0.1 * least;
  const auto grown = [&](double by) {
    Geom other = g;
    for (int k = 0; k < 3; ++k)
      if (g.size[k] > 0 && !(g.kind == GeomKind::capsule && k == 1)) other.size[k] += by;
    return solid_mass(other);
  };
  constexpr double kWeights[] = {45, -9, 1};
  Mass m;
  for (int k = 1; k <= 3; ++k) {
    const Mass outer = grown(k * t), inner = grown(-k * t);
    m.mass += kWeights[k - 1] * (outer.mass - inner.mass) / (60 * t);
    m.inertia += kWeights[k - 1] * (outer.inertia - inner.inertia) / (60 * t);
  }
  if (g.kind != GeomKind::ellipsoid) return m;
  constexpr double kPower = 1.6075;
  const auto both = [&](int i, int j) { return std::pow(g.size[i] * g.size[j], kPower); };
  const double area = 4 * kPi * std::pow((both(0, 1) + both(0, 2) + both(1, 2)) / 3, 1 / kPower);
  m.inertia *= area / m.mass;
  m.mass = area;
  return m;
}

Mass mesh_mass(const Geom& g, MeshInertia how) {
  const contact::Triangles soup = contact::read_triangles(g.file, g.scale);
  const auto corner = [&](const std::array<Index, 3>& t, std::size_t k) -> const Vec3& {
    return soup.points[at(t[k])];
  };
  double area = 0;
  Vec3 middle = Vec3::Zero();
  for (const auto& t : soup.triangles) {
    const double a = 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm();
    area += a;
    middle += a * (corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3;
  }
  if (!(area > 0)) throw Error(StatusCode::invalid_input, g.file + ": its triangles have no area");
  middle /= area;
  const bool shell = how == MeshInertia::shell;
  const auto weight = [&](const std::array<Index, 3>& t, const Vec3& apex) {
    const Vec3 a = corner(t, 0) - apex, b = corner(t, 1) - apex, c = corner(t, 2) - apex;
    if (shell) return 0.5 * (b - a).cross(c - a).norm();
    const double v = a.dot(b.cross(c)) / 6;
    return how == MeshInertia::legacy ? std::abs(v) : v;
  };
  Mass m;
  for (const auto& t : soup.triangles) {
    const double w = weight(t, middle);
    const Vec3 sum = corner(t, 0) + corner(t, 1) + corner(t, 2);
    m.mass += w;
    m.centre += w * (shell ? Vec3(sum / 3) : Vec3((sum + middle) / 4));
  }
  if (!(m.mass > 0))
    throw Error(
        StatusCode::invalid_input,
        fmt::format("{}: the volume inside is {:f}; its triangles must be closed and look outwards (or give the "
                    "body an <inertial>)",
                    g.file, m.mass));
  m.centre /= m.mass;
  // Integrals of x x^T over tetrahedra with one corner in the centre, and over triangles (exact for polynomials).
  Mat3 second = Mat3::Zero();
  m.mass = 0;  // of legacy: that of the pyramids to the centre
  for (const auto& t : soup.triangles) {
    const double volume = weight(t, m.centre), w = volume / (shell ? 12 : 20);
    m.mass += volume;
    const Vec3 a = corner(t, 0) - m.centre, b = corner(t, 1) - m.centre, c = corner(t, 2) - m.centre, sum = a + b + c;
    second += w * (sum * sum.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose());
  }
  m.inertia = second.trace() * Mat3::Identity() - second;
  return m;
}

}  // namespace

Mass moved(const Mass& mass, const Pose& pose) {
  return {mass.mass, pose * mass.centre, pose.r * mass.inertia * pose.r.transpose()};
}

Mass bounded(Mass m, double least_mass, double least_inertia, bool balanced) {
  m.mass = std::max(m.mass, least_mass);
  Vec3 principal = dense::principal_values(m.inertia);
  if (principal[0] < least_inertia) {
    const dense::Spectrum s = dense::symmetric_eigen(m.inertia);
    const Mat3 axes = s.vectors;
    principal = principal.cwiseMax(least_inertia);
    m.inertia = axes * principal.asDiagonal() * axes.transpose();
  }
  if (balanced && principal[0] + principal[1] < principal[2] * (1 - 1e-9))
    m.inertia = m.inertia.trace() / 3 * Mat3::Identity();
  return m;
}

Mass sum_of(const std::vector<Mass>& parts) {
  Mass m;
  for (const Mass& part : parts) {
    m.mass += part.mass;
    m.centre += part.mass * part.centre;
  }
  if (m.mass > 0) m.centre /= m.mass;
  for (const Mass& part : parts) {
    const Vec3 d = part.centre - m.centre;
    m.inertia += part.inertia + part.mass * (d.squaredNorm() * Mat3::Identity() - d * d.transpose());
  }
  return m;
}

Mass unit_mass(const Geom& geom, bool shell, MeshInertia mesh) {
  if (geom.kind == GeomKind::plane) return {};
  if (geom.kind == GeomKind::mesh) return moved(mesh_mass(geom, shell ? MeshInertia::shell : mesh), geom.pose);
  return moved(shell ? shell_mass(geom) : solid_mass(geom), geom.pose);
}

}  // namespace espalier::dynamics::model::robots
