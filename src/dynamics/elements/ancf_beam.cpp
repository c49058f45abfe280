#include "dynamics/elements/ancf_beam.hpp"

#include <algorithm>

#include "dynamics/elements/beam_strain.hpp"
#include "dynamics/elements/line_point.hpp"

namespace espalier::dynamics {
namespace {

constexpr int kVertices = 8;
constexpr int kDofs = 3 * kVertices;
constexpr int kAxis[4] = {0, 1, 4, 5};  // vertices of r1, r1_x, r2, r2_x
constexpr int kSlope[2] = {1, 5};
constexpr int kY[2] = {2, 6};
constexpr int kZ[2] = {3, 7};

/// r_y and r_z of a node as the six variables of jets.
template <int kOrder>
ESPALIER_INLINE void section_vectors(const double* x, int node, Jet3<6, kOrder> (&v)[2]) {
  for (int i = 0; i < 3; ++i) {
    v[0].x[i] = Jet<6, kOrder>::variable(x[3 * kY[node] + i], i);
    v[1].x[i] = Jet<6, kOrder>::variable(x[3 * kZ[node] + i], 3 + i);
  }
}

/// The variables of the strains at x, and how the small rotations hang on r_y and r_z.
template <int kOrder>
struct Kinematics {
  BeamState state;
  Jet3<6, kOrder> turn[2];

  ESPALIER_INLINE bool set(const double* x) {
    for (int node = 0; node < 2; ++node) {
      Jet3<6, kOrder> v[2];
      section_vectors<kOrder>(x, node, v);
      const SectionFrame<6, kOrder> frame = section_frame(v[0], v[1]);
      if (!frame.ok) return false;
      frame_values(frame, state.frame[node]);
      turn[node] = small_rotation(frame);
      std::copy_n(x + 3 * kSlope[node], 3, state.slope[node]);
    }
    for (int i = 0; i < 3; ++i) state.chord[i] = x[3 * kAxis[2] + i] - x[3 * kAxis[0] + i];
    return true;
  }

  /// dz/dq: derivatives of the variables by the coordinates, also their rates for given velocities.
  ESPALIER_INLINE void derivatives(double (&dz)[kBeamVariables][kDofs]) const {
    for (int i = 0; i < 3; ++i) {
      dz[kChord + i][3 * kAxis[0] + i] = -1;
      dz[kChord + i][3 * kAxis[2] + i] = 1;
      for (int node = 0; node < 2; ++node) {
        dz[(node == 0 ? kSlope1 : kSlope2) + i][3 * kSlope[node] + i] = 1;
        for (int j = 0; j < 6; ++j) dz[(node == 0 ? kTurn1 : kTurn2) + i][column(node, j)] = turn[node].x[i].g[j];
      }
    }
  }

  /// Coordinate of variable j of section_vectors().
  static constexpr int column(int node, int j) { return 3 * (j < 3 ? kY[node] : kZ[node]) + j % 3; }
};

/// Tangent from the sum over the strains by z: (dz/dq)^T (H dz/dq + V (z'' dq/dt)) + sum_k gradient_k z_k''.
ESPALIER_INLINE void add_tangent(const StrainSum<kBeamVariables>& sum, const Kinematics<2>& kinematics,
                                 const double (&dz)[kBeamVariables][kDofs], const ElementInput& in, double* tangent) {
  double right[kBeamVariables][kDofs] = {}, bend[kBeamVariables][kDofs] = {};
  for (int node = 0; node < 2; ++node)
    for (int k = 0; k < 3; ++k) {
      const int row = (node == 0 ? kTurn1 : kTurn2) + k;
      const auto& h = kinematics.turn[node].x[k].h;
      for (int a = 0; a < 6; ++a)
        for (int b = 0; b < 6; ++b) {
          const int to = Kinematics<2>::column(node, a), from = Kinematics<2>::column(node, b);
          tangent[from * kDofs + to] += in.position_weight * sum.gradient[row] * h[a][b];
          if (in.damping != 0 && in.velocity != nullptr) bend[row][to] += h[a][b] * in.velocity[from];
        }
    }
  for (int i = 0; i < kBeamVariables; ++i)
    for (int k = 0; k < kBeamVariables; ++k)
      for (int c = 0; c < kDofs; ++c) right[i][c] += sum.hessian[i][k] * dz[k][c] + sum.viscous[i][k] * bend[k][c];
  for (int c = 0; c < kDofs; ++c)
    for (int i = 0; i < kBeamVariables; ++i)
      for (int r = 0; r < kDofs; ++r) tangent[c * kDofs + r] += right[i][c] * dz[i][r];
}

/// Weights of the strains of beam_strains(): those of the Legendre polynomials over the length are L, L / 3, L / 5.
ESPALIER_INLINE void beam_stiffness(const BeamSection& s, double (&d)[kBeamStrains]) {
  const double values[kBeamStrains] = {s.axial,       s.axial / 3,     s.axial / 5,   s.shear_y,
                                       s.shear_y / 3, s.shear_z,       s.shear_z / 3, s.torsion,
                                       s.bending_y,   s.bending_y / 3, s.bending_z,   s.bending_z / 3};
  std::copy_n(values, kBeamStrains, d);
}

template <int kOrder>
ESPALIER_INLINE bool add_beam(const BeamSection& section, double length, const ElementInput& in, ElementOutput& out) {
  Kinematics<0> reference;
  Kinematics<kOrder> now;
  Jet<kBeamVariables, 0> initial[kBeamStrains];
  Jet<kBeamVariables, kOrder> strains[kBeamStrains], relief[1];
  Jet3<kBeamVariables, 0> initial_phi;
  Jet3<kBeamVariables, kOrder> phi;
  if (!reference.set(in.reference) || !beam_strains<0>(reference.state, length, initial, initial_phi)) return false;
  if (!now.set(in.position) || !beam_strains<kOrder>(now.state, length, strains, phi)) return false;
  double natural[kBeamStrains], stiffness[kBeamStrains], dz[kBeamVariables][kDofs] = {}, rate[kBeamVariables] = {};
  for (int s = 0; s < kBeamStrains; ++s) natural[s] = initial[s].v;
  beam_stiffness(section, stiffness);
  relief[0] = torsion_relief({section.torsion, section.bending_y, section.bending_z}, length, strains, natural, phi);
  now.derivatives(dz);
  if (in.damping != 0 && in.velocity != nullptr)
    for (int k = 0; k < kBeamVariables; ++k)
      for (int c = 0; c < kDofs; ++c) rate[k] += dz[k][c] * in.velocity[c];
  StrainSum<kBeamVariables> sum;
  sum_strains(strains, natural, stiffness, length, rate, in, sum, out.energy);
  sum_strains(relief, {0}, {-1}, 1, rate, in, sum, out.energy);
  for (int k = 0; k < kBeamVariables; ++k)
    for (int c = 0; c < kDofs; ++c) out.force[c] += sum.gradient[k] * dz[k][c];
  if constexpr (kOrder > 1) add_tangent(sum, now, dz, in, out.tangent);
  return true;
}

/// The section's own strains at the nodes: [(r_y . r_y - 1) / 2, (r_z . r_z - 1) / 2, r_y . r_z].
template <int kOrder>
ESPALIER_INLINE void section_strains(const double* x, int node, Jet<6, kOrder> (&e)[3]) {
  Jet3<6, kOrder> v[2];
  section_vectors<kOrder>(x, node, v);
  e[0] = 0.5 * dot(v[0], v[0]);
  e[1] = 0.5 * dot(v[1], v[1]);
  e[2] = dot(v[0], v[1]);
}

template <int kOrder>
ESPALIER_INLINE void add_section(const BeamSection& s, double length, const ElementInput& in, ElementOutput& out) {
  for (int node = 0; node < 2; ++node) {
    PointVectors<2, kVertices> vectors;
    vectors.c[0][kY[node]] = vectors.c[1][kZ[node]] = 1;
    Jet<6, 0> initial[3];
    Jet<6, kOrder> strains[3];
    section_strains<0>(in.reference, node, initial);
    section_strains<kOrder>(in.position, node, strains);
    add_line_point(vectors, strains, {initial[0].v, initial[1].v, initial[2].v},
                   {s.section_normal, s.section_normal, s.section_shear}, 0.5 * length, in, out);
  }
}

ESPALIER_CLONES bool evaluate_force(const BeamSection& section, double length, const ElementInput& in,
                                    ElementOutput& out) {
  if (!add_beam<1>(section, length, in, out)) return false;
  add_section<1>(section, length, in, out);
  return true;
}

ESPALIER_CLONES bool evaluate_tangent(const BeamSection& section, double length, const ElementInput& in,
                                      ElementOutput& out) {
  if (!add_beam<2>(section, length, in, out)) return false;
  add_section<2>(section, length, in, out);
  return true;
}

}  // namespace

bool evaluate_beam(const BeamSection& section, double length, const ElementInput& in, ElementOutput& out) {
  std::fill_n(out.force, kDofs, 0.0);
  out.energy = 0;
  if (out.tangent == nullptr) return evaluate_force(section, length, in, out);
  std::fill_n(out.tangent, kDofs * kDofs, 0.0);
  return evaluate_tangent(section, length, in, out);
}

bool sample_beam(const BeamSection& section, double length, const double* reference, const double* position,
                 ElementSamples& out) {
  Kinematics<0> initial, now;
  Jet<kBeamVariables, 0> natural[kBeamStrains], strains[kBeamStrains];
  Jet3<kBeamVariables, 0> initial_phi, phi;
  if (!initial.set(reference) || !beam_strains<0>(initial.state, length, natural, initial_phi)) return false;
  if (!now.set(position) || !beam_strains<0>(now.state, length, strains, phi)) return false;
  double d[kBeamStrains];
  for (int s = 0; s < kBeamStrains; ++s) d[s] = strains[s].v - natural[s].v;
  // b_1 of the torsion's slope, see beam_strain.hpp: what c = 0 leaves the least energy.
  const double y = phi.x[1].v, z = phi.x[2].v;
  const double c = 2.0 / 3 * (section.bending_y * z * d[8] - section.bending_z * y * d[10]);
  const double k = 16.0 / 3 * section.torsion + 4.0 / 9 * (section.bending_y * z * z + section.bending_z * y * y);
  const double per = (k > 0 ? -c * length / k : 0) / length;
  for (int p = 0; p < 3; ++p) {
    const double xi = p - 1;
    const double force[6] = {section.axial * (d[0] + xi * d[1] + 0.5 * (3 * xi * xi - 1) * d[2]),
                             section.shear_y * (d[3] + xi * d[4]),
                             section.shear_z * (d[5] + xi * d[6]),
                             section.torsion * (d[7] - 4 * per * xi),
                             section.bending_y * (d[8] + 2.0 / 3 * per * z + xi * d[9]),
                             section.bending_z * (d[10] - 2.0 / 3 * per * y + xi * d[11])};
    std::copy_n(force, 6, out.value[p]);
  }
  return true;
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
