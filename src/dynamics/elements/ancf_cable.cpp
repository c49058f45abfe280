#include "dynamics/elements/ancf_cable.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/elements/line_point.hpp"
#include "dynamics/elements/small_vector.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kVertices = 4;
constexpr int kParts = 3;  // chord r2 - r1, slopes r1_x and r2_x: positions count by their difference alone

/// sum c_k v_k
V3 sum_of(const double (&c)[kParts], const V3 (&v)[kParts]) { return c[0] * v[0] + c[1] * v[1] + c[2] * v[2]; }

void read_parts(const double* x, V3 (&v)[kParts]) {
  for (int i = 0; i < 3; ++i) {
    v[0].x[i] = x[6 + i] - x[i];
    v[1].x[i] = x[3 + i];
    v[2].x[i] = x[9 + i];
  }
}

}  // namespace

bool sample_cable(const CableSection& section, double length, const double* position, ElementSamples& out) {
  V3 parts[kParts];
  read_parts(position, parts);
  double mean[4] = {}, slope[4] = {};  // of N and the moment
  const auto add = [&](int i, const LinePoint& at, double value) {
    mean[i] += 0.5 * at.weight * value;
    slope[i] += 1.5 * at.weight * at.xi * value;
  };
  const auto slope_at = [&](const Hermite& h) { return sum_of({h.d[2], h.d[1], h.d[3]}, parts); };
  for (const LinePoint& at : kGauss5) {
    const V3 tangent = slope_at(Hermite(at.xi, length));
    const double stretch = std::sqrt(dot(tangent, tangent));
    if (!(stretch > 0)) return false;
    add(0, at, section.axial * (stretch - 1));
  }
  for (const LinePoint& at : kGauss3) {
    const Hermite h(at.xi, length);
    const V3 a = slope_at(h), b = sum_of({h.dd[2], h.dd[1], h.dd[3]}, parts), turn = cross(a, b);
    for (int i = 0; i < 3; ++i) add(1 + i, at, section.bending / dot(a, a) * turn.x[i]);
  }
  for (int p = 0; p < 3; ++p)
    for (int i = 0; i < 4; ++i) out.value[p][i] = mean[i] + (p - 1) * slope[i];
  return true;
}

void cable_mass(const CableSection& section, double length, double* m) {
  std::fill_n(m, kVertices * kVertices, 0.0);
  for (const LinePoint& point : kGauss5) {  // degree 9 >= 6
    const Hermite shape(point.xi, length);
    const double weight = 0.5 * length * point.weight * section.mass_per_length;
    for (int b = 0; b < kVertices; ++b)
      for (int a = 0; a < kVertices; ++a) m[b * kVertices + a] += weight * shape.n[a] * shape.n[b];
  }
}

}  // namespace espalier::dynamics
