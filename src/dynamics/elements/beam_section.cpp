#include "dynamics/elements/beam_section.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace espalier::dynamics {
namespace {

/// Saint-Venant's torsion constant of a rectangle a x b, a >= b (Timoshenko and Goodier, section 109):
/// J = a b^3 (1/3 - 64/pi^5 b/a sum_(odd n) tanh(n pi a / (2 b)) / n^5). Terms beyond n = 99 are below 1e-10.
double rectangle_torsion(double side1, double side2) {
  const double a = std::max(side1, side2), b = std::min(side1, side2);
  double sum = 0;
  for (int n = 99; n >= 1; n -= 2) sum += std::tanh(n * std::numbers::pi * a / (2 * b)) / std::pow(n, 5);
  return a * b * b * b * (1.0 / 3 - 64 / std::pow(std::numbers::pi, 5) * b / a * sum);
}

/// Where forces along y and z have shear areas of their own.
BeamSection thin_section(const Material& m, double area, double iy, double iz, double torsion,
                         const std::array<double, 2>& shear_areas) {
  BeamSection s = section_of(m, area, iy, iz, torsion, 1);
  s.shear_y = m.mu() * shear_areas[0];
  s.shear_z = m.mu() * shear_areas[1];
  return s;
}

double cube(double x) { return x * x * x; }

}  // namespace

BeamSection section_of(const Material& m, double area, double iy, double iz, double torsion, double shear) {
  const double g = m.mu();
  BeamSection s;
  s.axial = s.section_normal = m.young * area;
  s.shear_y = s.shear_z = shear * g * area;
  s.section_shear = g * area;
  s.torsion = g * torsion;
  s.bending_y = m.young * iy;
  s.bending_z = m.young * iz;
  s.mass_per_length = m.density * area;
  s.inertia_y = m.density * iz;
  s.inertia_z = m.density * iy;
  return s;
}

BeamSection tube_section(const Material& m, double outer, double wall) {
  const double inner = outer - wall, ratio = inner / outer, more = 1 + ratio * ratio;
  const double area = std::numbers::pi * (outer * outer - inner * inner);
  const double i = 0.25 * area * (outer * outer + inner * inner);
  return section_of(
      m, area, i, i, 2 * i,
      6 * (1 + m.poisson) * more * more / ((7 + 6 * m.poisson) * more * more + (20 + 12 * m.poisson) * ratio * ratio));
}

BeamSection box_section(const Material& m, const BoxShape& b) {
  const double inner_h = b.height - 2 * b.wall_y, inner_w = b.width - 2 * b.wall_z;
  const double h = b.height - b.wall_y, w = b.width - b.wall_z;  // between the middles of walls
  const double bredt = 4 * cube(h) * cube(w) / (h * w) / (2 * h / b.wall_z + 2 * w / b.wall_y);
  return thin_section(
      m, b.height * b.width - inner_h * inner_w, (b.height * cube(b.width) - inner_h * cube(inner_w)) / 12,
      (b.width * cube(b.height) - inner_w * cube(inner_h)) / 12, bredt, {2 * h * b.wall_z, 2 * w * b.wall_y});
}

BeamSection i_section(const Material& m, const IShape& s) {
  const double inner = s.height - 2 * s.flange, between = s.height - s.flange;
  return thin_section(
      m, 2 * s.width * s.flange + inner * s.web, (2 * s.flange * cube(s.width) + inner * cube(s.web)) / 12,
      (s.width * cube(s.height) - (s.width - s.web) * cube(inner)) / 12,
      (2 * s.width * cube(s.flange) + between * cube(s.web)) / 3, {between * s.web, 2 * s.width * s.flange * 5 / 6});
}

BeamSection rectangular_section(const Material& m, double height, double width) {
  const double iz = width * height * height * height / 12, iy = height * width * width * width / 12;
  const double shear = 10 * (1 + m.poisson) / (12 + 11 * m.poisson);
  return section_of(m, height * width, iy, iz, rectangle_torsion(height, width), shear);
}

BeamSection circular_section(const Material& m, double radius) {
  const double area = std::numbers::pi * radius * radius, i = 0.25 * area * radius * radius;
  return section_of(m, area, i, i, 2 * i, 6 * (1 + m.poisson) / (7 + 6 * m.poisson));
}

}  // namespace espalier::dynamics
