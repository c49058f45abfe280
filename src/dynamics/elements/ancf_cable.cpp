#include "dynamics/elements/ancf_cable.hpp"

#include <algorithm>

#include "dynamics/elements/line_point.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kVertices = 4;
using Tangent = PointVectors<1, kVertices>;
using TangentAndCurvature = PointVectors<2, kVertices>;

template <int kOrder>
ESPALIER_INLINE bool add_axial(const CableSection& section, double length, const ElementInput& in, ElementOutput& out) {
  for (const LinePoint& point : kGauss5) {
    const Hermite shape(point.xi, length);
    Tangent vectors;
    std::copy_n(shape.d, kVertices, vectors.c[0]);
    double y[3];
    vectors.evaluate(in.position, y);
    Jet3<3, kOrder> slope;
    for (int i = 0; i < 3; ++i) slope.x[i] = Jet<3, kOrder>::variable(y[i], i);
    const Jet<3, kOrder> square = dot(slope, slope);
    if (!(square.v > 0)) return false;
    const Jet<3, kOrder> strains[1] = {sqrt(square) - 1.0};
    add_line_point(vectors, strains, {0}, {section.axial}, 0.5 * length * point.weight, in, out);
  }
  return true;
}

template <int kOrder>
ESPALIER_INLINE bool add_bending(const CableSection& section, double length, const ElementInput& in,
                                 ElementOutput& out) {
  for (const LinePoint& point : kGauss3) {
    const Hermite shape(point.xi, length);
    TangentAndCurvature vectors;
    std::copy_n(shape.d, kVertices, vectors.c[0]);
    std::copy_n(shape.dd, kVertices, vectors.c[1]);
    double y[6];
    vectors.evaluate(in.position, y);
    Jet3<6, kOrder> slope, bend;
    for (int i = 0; i < 3; ++i) {
      slope.x[i] = Jet<6, kOrder>::variable(y[i], i);
      bend.x[i] = Jet<6, kOrder>::variable(y[3 + i], 3 + i);
    }
    const Jet<6, kOrder> square = dot(slope, slope);
    if (!(square.v > 0)) return false;
    const Jet3<6, kOrder> kappa = inverse(square) * cross(slope, bend);
    add_line_point(vectors, kappa.x, {0, 0, 0}, {section.bending, section.bending, section.bending},
                   0.5 * length * point.weight, in, out);
  }
  return true;
}

ESPALIER_CLONES bool evaluate_force(const CableSection& s, double length, const ElementInput& in, ElementOutput& out) {
  return add_axial<1>(s, length, in, out) && add_bending<1>(s, length, in, out);
}
ESPALIER_CLONES bool evaluate_tangent(const CableSection& s, double length, const ElementInput& in,
                                      ElementOutput& out) {
  return add_axial<2>(s, length, in, out) && add_bending<2>(s, length, in, out);
}

}  // namespace

bool evaluate_cable(const CableSection& section, double length, const ElementInput& in, ElementOutput& out) {
  std::fill_n(out.force, 3 * kVertices, 0.0);
  out.energy = 0;
  if (out.tangent == nullptr) return evaluate_force(section, length, in, out);
  std::fill_n(out.tangent, 9 * kVertices * kVertices, 0.0);
  return evaluate_tangent(section, length, in, out);
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
