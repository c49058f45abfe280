#include "dynamics/elements/ancf_beam.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamics/elements/line_point.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kVertices = 8;
constexpr int kAxis[4] = {0, 1, 4, 5};  // vertices of r1, r1_x, r2, r2_x
constexpr int kY[2] = {2, 6};
constexpr int kZ[2] = {3, 7};

/// Point vectors of the force strains: r', r_y, r_z.
using ForceVectors = PointVectors<3, kVertices>;
/// Point vectors of the moment strains: r_y, r_z, r_y', r_z'.
using MomentVectors = PointVectors<4, kVertices>;
/// r_y and r_z at a node.
using SectionVectors = PointVectors<2, kVertices>;

/// The orthonormal frame that follows the cross-section: t3 along r_z, t1 along r_y x r_z.
template <int kN>
struct SectionFrame {
  Jet3<kN> t1, t2, t3;
  Jet<kN> inverse_z;  // 1 / |r_z|
  Jet<kN> inverse_n;  // 1 / |r_y x t3|
  bool ok = false;
};

template <int kN>
ESPALIER_INLINE void make_frame(const Jet3<kN>& ry, const Jet3<kN>& rz, SectionFrame<kN>& f) {
  const Jet<kN> zz = dot(rz, rz);
  f.ok = zz.v > 0;
  if (!f.ok) return;
  f.inverse_z = inverse(sqrt(zz));
  f.t3 = f.inverse_z * rz;
  const Jet3<kN> n = cross(ry, f.t3);
  const Jet<kN> nn = dot(n, n);
  f.ok = nn.v > 0;
  if (!f.ok) return;
  f.inverse_n = inverse(sqrt(nn));
  f.t1 = f.inverse_n * n;
  f.t2 = cross(f.t3, f.t1);
}

template <int kPv>
ESPALIER_INLINE void make_variables(const double (&y)[3 * kPv], Jet3<3 * kPv> (&vectors)[kPv]) {
  for (int p = 0; p < kPv; ++p)
    for (int i = 0; i < 3; ++i) vectors[p].x[i] = Jet<3 * kPv>::variable(y[3 * p + i], 3 * p + i);
}

/// Gamma = [t1 . r', t2 . r', t3 . r'] (the natural value of the first is that of the reference, about 1).
ESPALIER_INLINE bool force_strains(const ForceVectors& vectors, const double* x, Jet<9> (&e)[3]) {
  double y[9];
  Jet3<9> v[3];
  SectionFrame<9> frame;
  vectors.evaluate(x, y);
  make_variables<3>(y, v);
  make_frame(v[1], v[2], frame);
  if (!frame.ok) return false;
  e[0] = dot(frame.t1, v[0]);
  e[1] = dot(frame.t2, v[0]);
  e[2] = dot(frame.t3, v[0]);
  return true;
}

/// kappa = [-t2 . t3', t1 . t3', t2 . t1'] with t3' = (r_z' - t3 (t3 . r_z')) / |r_z| and t1' along t2 from
/// n = r_y x t3. The part of t3' along t3 drops out of the first two.
ESPALIER_INLINE bool moment_strains(const MomentVectors& vectors, const double* x, Jet<12> (&e)[3]) {
  double y[12];
  Jet3<12> v[4];
  SectionFrame<12> frame;
  vectors.evaluate(x, y);
  make_variables<4>(y, v);
  make_frame(v[0], v[1], frame);
  if (!frame.ok) return false;
  const Jet3<12> turn = frame.inverse_z * v[3];
  const Jet<12> along = dot(frame.t3, turn);
  Jet3<12> dt3 = turn;
  for (int i = 0; i < 3; ++i) dt3.x[i] -= along * frame.t3.x[i];
  e[0] = -1.0 * dot(frame.t2, turn);
  e[1] = dot(frame.t1, turn);
  e[2] = frame.inverse_n * dot(frame.t2, cross(v[2], frame.t3) + cross(v[0], dt3));
  return true;
}

/// [(r_y . r_y - 1) / 2, (r_z . r_z - 1) / 2, r_y . r_z]
ESPALIER_INLINE void section_strains(const SectionVectors& vectors, const double* x, Jet<6> (&e)[3]) {
  double y[6];
  Jet3<6> v[2];
  vectors.evaluate(x, y);
  make_variables<2>(y, v);
  e[0] = 0.5 * dot(v[0], v[0]);
  e[1] = 0.5 * dot(v[1], v[1]);
  e[2] = dot(v[0], v[1]);
}

template <int kPv>
ESPALIER_INLINE void linear_row(double xi, const int (&vertices)[2], PointVectors<kPv, kVertices>& vectors, int row) {
  vectors.c[row][vertices[0]] = 0.5 * (1 - xi);
  vectors.c[row][vertices[1]] = 0.5 * (1 + xi);
}

template <class J, int kS>
ESPALIER_INLINE void values(const J (&jets)[kS], double (&v)[kS]) {
  for (int s = 0; s < kS; ++s) v[s] = jets[s].v;
}

ESPALIER_INLINE bool add_forces(const BeamSection& s, double length, const ElementInput& in, ElementOutput& out) {
  for (const LinePoint& point : kGauss3) {
    const Hermite shape(point.xi, length);
    ForceVectors vectors;
    for (int k = 0; k < 4; ++k) vectors.c[0][kAxis[k]] = shape.d[k];
    linear_row(point.xi, kY, vectors, 1);
    linear_row(point.xi, kZ, vectors, 2);
    Jet<9> strains[3];
    double natural[3];
    if (!force_strains(vectors, in.reference, strains)) return false;
    values(strains, natural);
    if (!force_strains(vectors, in.position, strains)) return false;
    add_line_point(vectors, strains, natural, {s.axial, s.shear_y, s.shear_z}, 0.5 * length * point.weight, in, out);
  }
  return true;
}

ESPALIER_INLINE bool add_moments(const BeamSection& s, double length, const ElementInput& in, ElementOutput& out) {
  for (const LinePoint& point : kGauss2) {
    MomentVectors vectors;
    linear_row(point.xi, kY, vectors, 0);
    linear_row(point.xi, kZ, vectors, 1);
    for (int k = 0; k < 2; ++k) vectors.c[2][kY[k]] = vectors.c[3][kZ[k]] = (k == 0 ? -1 : 1) / length;
    Jet<12> strains[3];
    double natural[3];
    if (!moment_strains(vectors, in.reference, strains)) return false;
    values(strains, natural);
    if (!moment_strains(vectors, in.position, strains)) return false;
    add_line_point(vectors, strains, natural, {s.torsion, s.bending_y, s.bending_z}, 0.5 * length * point.weight, in,
                   out);
  }
  return true;
}

ESPALIER_INLINE void add_section(const BeamSection& s, double length, const ElementInput& in, ElementOutput& out) {
  for (int node = 0; node < 2; ++node) {
    SectionVectors vectors;
    vectors.c[0][kY[node]] = vectors.c[1][kZ[node]] = 1;
    Jet<6> strains[3];
    double natural[3];
    section_strains(vectors, in.reference, strains);
    values(strains, natural);
    section_strains(vectors, in.position, strains);
    add_line_point(vectors, strains, natural, {s.section_normal, s.section_normal, s.section_shear}, 0.5 * length, in,
                   out);
  }
}

ESPALIER_CLONES bool evaluate(const BeamSection& section, double length, const ElementInput& in, ElementOutput& out) {
  std::fill_n(out.force, 3 * kVertices, 0.0);
  if (out.tangent != nullptr) std::fill_n(out.tangent, 9 * kVertices * kVertices, 0.0);
  out.energy = 0;
  if (!add_forces(section, length, in, out) || !add_moments(section, length, in, out)) return false;
  add_section(section, length, in, out);
  return true;
}

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

bool evaluate_beam(const BeamSection& section, double length, const ElementInput& in, ElementOutput& out) {
  return evaluate(section, length, in, out);
}

void beam_mass(const BeamSection& section, double length, double* m) {
  std::fill_n(m, kVertices * kVertices, 0.0);
  for (const LinePoint& point : kGauss5) {  // degree 9 >= 6
    const Hermite shape(point.xi, length);
    const double weight = 0.5 * length * point.weight * section.mass_per_length;
    for (int b = 0; b < 4; ++b)
      for (int a = 0; a < 4; ++a) m[kAxis[b] * kVertices + kAxis[a]] += weight * shape.n[a] * shape.n[b];
  }
  for (int b = 0; b < 2; ++b)
    for (int a = 0; a < 2; ++a) {  // integral of the products of the two linear functions
      const double linear = length * (a == b ? 1.0 / 3 : 1.0 / 6);
      m[kY[b] * kVertices + kY[a]] = section.inertia_y * linear;
      m[kZ[b] * kVertices + kZ[a]] = section.inertia_z * linear;
    }
}

}  // namespace espalier::dynamics
