#include "dynamics/elements/beam_section.hpp"

#include <algorithm>
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

}  // namespace

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
