// One ANCF cable and one ANCF shell: the second implementations that ancf_block_test.cpp compares with.
#include <algorithm>
#include <cmath>

#include "dynamics/elements/line_point.hpp"
#include "dynamics/elements/oracles.hpp"
#include "dynamics/elements/small_vector.hpp"

namespace espalier::dynamics::oracle {
namespace {

constexpr int kVertices = 4;
constexpr int kCableDofs = 3 * kVertices;
constexpr int kParts = 3;  // chord r2 - r1, slopes r1_x and r2_x

/// m[j][i]: row i, column j (by columns, as element tangents are).
struct M3 {
  double m[3][3] = {};

  /// += s a b^T
  ESPALIER_INLINE void add_outer(double s, const V3& a, const V3& b) {
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) m[j][i] += s * a.x[i] * b.x[j];
  }
  /// += s I
  ESPALIER_INLINE void add_identity(double s) {
    for (int i = 0; i < 3; ++i) m[i][i] += s;
  }
  /// += s [a]_x, [a]_x b = a x b
  ESPALIER_INLINE void add_cross(double s, const V3& a) {
    m[1][0] -= s * a.x[2];
    m[0][1] += s * a.x[2];
    m[2][0] += s * a.x[1];
    m[0][2] -= s * a.x[1];
    m[2][1] -= s * a.x[0];
    m[1][2] += s * a.x[0];
  }
  /// += s a
  ESPALIER_INLINE void add(double s, const M3& a) {
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) m[j][i] += s * a.m[j][i];
  }
  /// += a^T b
  ESPALIER_INLINE void add_transposed_product(const M3& a, const M3& b) {
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) m[j][i] += a.m[i][0] * b.m[j][0] + a.m[i][1] * b.m[j][1] + a.m[i][2] * b.m[j][2];
  }
};

/// Shape functions on an element of length 1 at the points of a rule, found once.
template <std::size_t kPoints>
struct ShapeFunctions {
  double d[kPoints][kParts], dd[kPoints][kParts], weight[kPoints];
  explicit ShapeFunctions(const LinePoint (&rule)[kPoints]) {
    for (std::size_t k = 0; k < kPoints; ++k) {
      const Hermite h(rule[k].xi, 1);
      const double first[kParts] = {h.d[2], h.d[1], h.d[3]}, second[kParts] = {h.dd[2], h.dd[1], h.dd[3]};
      std::copy_n(first, kParts, d[k]);
      std::copy_n(second, kParts, dd[k]);
      weight[k] = 0.5 * rule[k].weight;
    }
  }
};
const ShapeFunctions<5> kAxialShapes(kGauss5);
const ShapeFunctions<3> kBendingShapes(kGauss3);

/// Chord and slopes, and what belongs to them: forces, and blocks of the tangent by pairs.
struct Terms {
  V3 at[kParts], rate[kParts], force[kParts];
  M3 tangent[kParts][kParts];  // [column][row]
  double energy = 0;

  /// sum c_k at_k
  ESPALIER_INLINE static V3 sum(const double (&c)[kParts], const V3 (&v)[kParts]) {
    return c[0] * v[0] + c[1] * v[1] + c[2] * v[2];
  }
};

/// How the tangent is wanted, times the stiffness and the weight of a point (see ElementInput).
struct Weights {
  double stiffness, elastic, viscous, damping;
  Weights(double d, const ElementInput& in)
      : stiffness(d),
        elastic(in.position_weight),
        viscous(d * (in.position_weight + in.damping * in.velocity_weight)),
        damping(in.velocity == nullptr ? 0 : in.damping) {}
};

/// eps = |r'| - 1: eps' = t = r' / |r'|, eps'' = (I - t t^T) / |r'|.
template <bool kTangent>
ESPALIER_INLINE bool add_axial(const double (&c)[kParts], const Weights& w, Terms& parts) {
  const V3 slope = Terms::sum(c, parts.at);
  const double length = std::sqrt(dot(slope, slope));
  if (!(length > 0)) return false;
  const V3 t = (1 / length) * slope;
  const double strain = length - 1;
  V3 rate;
  if (w.damping != 0) rate = Terms::sum(c, parts.rate);
  const double along = dot(t, rate), stress = w.stiffness * (strain + w.damping * along);
  parts.energy += 0.5 * w.stiffness * strain * strain;
  for (int a = 0; a < kParts; ++a) parts.force[a] = parts.force[a] + (c[a] * stress) * t;
  if constexpr (kTangent) {
    const double across = w.elastic * stress / length;
    M3 h;
    h.add_outer(w.viscous - across, t, t);
    h.add_identity(across);
    if (w.damping != 0) h.add_outer(w.elastic * w.stiffness * w.damping / length, t, rate - along * t);
    for (int b = 0; b < kParts; ++b)
      for (int a = 0; a < kParts; ++a) parts.tangent[b][a].add(c[a] * c[b], h);
  }
  return true;
}

/// kappa = q a x b with a = r', b = r'', q = 1 / |a|^2.
struct Curvature {
  V3 a, b, kappa, rate_a, rate_b, rate;
  double q = 0;

  /// kappa' by a and by b, applied to v: q v x b - 2 q (a . v) kappa and q a x v.
  ESPALIER_INLINE V3 change(const V3& va, const V3& vb) const {
    return q * (cross(va, b) + cross(a, vb)) - (2 * q * dot(a, va)) * kappa;
  }
  ESPALIER_INLINE void derivative(M3 (&k)[2]) const {
    k[0].add_cross(-q, b);
    k[0].add_outer(-2 * q, kappa, a);
    k[1].add_cross(q, a);
  }
  /// Derivatives of change(rate_a, rate_b) by a and b.
  ESPALIER_INLINE void rate_derivative(const M3 (&k)[2], M3 (&c)[2]) const {
    const double along = dot(a, rate_a);
    c[0].add_outer(-2 * q * q, cross(rate_a, b) + cross(a, rate_b), a);
    c[0].add_cross(-q, rate_b);
    c[0].add_outer(-2 * q, kappa, rate_a);
    c[0].add_outer(4 * q * q * along, kappa, a);
    c[0].add(-2 * q * along, k[0]);
    c[1].add_cross(q, rate_a);
    c[1].add(-2 * q * along, k[1]);
  }
  /// Second derivatives of m . kappa for a moment m held constant, times s; `ga`, `gb` are its first ones.
  ESPALIER_INLINE void add_second(double s, const V3& m, const V3& ga, const V3& gb, M3 (&h)[2][2]) const {
    const double work = dot(m, kappa);
    h[0][0].add_outer(-2 * s * q * q, cross(b, m), a);
    h[0][0].add_outer(4 * s * q * q * work, a, a);
    h[0][0].add_outer(-2 * s * q, a, ga);
    h[0][0].add_identity(-2 * s * q * work);
    h[1][0].add_cross(-s * q, m);
    h[1][0].add_outer(-2 * s * q, a, gb);
    h[0][1].add_cross(s * q, m);
    h[0][1].add_outer(-2 * s * q, gb, a);
  }
};

/// h[column][row] by a and b: kappa'^T (viscous kappa' + damping (kappa'' rate)) + elastic (m . kappa)''.
ESPALIER_INLINE void bending_tangent(const Curvature& c, const Weights& w, const V3& moment, const V3& ga, const V3& gb,
                                     M3 (&h)[2][2]) {
  M3 k[2], right[2];
  c.derivative(k);
  if (w.damping != 0) {
    M3 rate[2];
    c.rate_derivative(k, rate);
    for (int y = 0; y < 2; ++y) right[y].add(w.elastic * w.stiffness * w.damping, rate[y]);
  }
  for (int y = 0; y < 2; ++y) {
    right[y].add(w.viscous, k[y]);
    for (int x = 0; x < 2; ++x) h[y][x].add_transposed_product(k[x], right[y]);
  }
  c.add_second(w.elastic, moment, ga, gb, h);
}

template <bool kTangent>
ESPALIER_INLINE bool add_bending(const double (&d)[kParts], const double (&dd)[kParts], const Weights& w,
                                 Terms& parts) {
  Curvature c;
  c.a = Terms::sum(d, parts.at);
  c.b = Terms::sum(dd, parts.at);
  const double square = dot(c.a, c.a);
  if (!(square > 0)) return false;
  c.q = 1 / square;
  c.kappa = c.q * cross(c.a, c.b);
  if (w.damping != 0) {
    c.rate_a = Terms::sum(d, parts.rate);
    c.rate_b = Terms::sum(dd, parts.rate);
    c.rate = c.change(c.rate_a, c.rate_b);
  }
  const V3 moment = w.stiffness * (c.kappa + w.damping * c.rate);
  parts.energy += 0.5 * w.stiffness * dot(c.kappa, c.kappa);
  // kappa'^T m
  const V3 ga = c.q * cross(c.b, moment) - (2 * c.q * dot(moment, c.kappa)) * c.a, gb = c.q * cross(moment, c.a);
  for (int k = 0; k < kParts; ++k) parts.force[k] = parts.force[k] + d[k] * ga + dd[k] * gb;
  if constexpr (kTangent) {
    M3 h[2][2];
    bending_tangent(c, w, moment, ga, gb, h);
    for (int col = 0; col < kParts; ++col) {
      M3 column[2];  // H times the column's share in a and b
      for (int x = 0; x < 2; ++x) {
        column[x].add(d[col], h[0][x]);
        column[x].add(dd[col], h[1][x]);
      }
      for (int row = 0; row < kParts; ++row) {
        parts.tangent[col][row].add(d[row], column[0]);
        parts.tangent[col][row].add(dd[row], column[1]);
      }
    }
  }
  return true;
}

ESPALIER_INLINE void read_parts(const double* x, V3 (&v)[kParts]) {
  for (int i = 0; i < 3; ++i) {
    v[0].x[i] = x[6 + i] - x[i];
    v[1].x[i] = x[3 + i];
    v[2].x[i] = x[9 + i];
  }
}

/// The share of vertex a in a part: r1, r1_x, r2, r2_x.
constexpr int kPartOf[kVertices] = {0, 1, 0, 2};
constexpr double kSign[kVertices] = {-1, 1, 1, 1};

template <bool kTangent>
ESPALIER_INLINE bool evaluate(const CableSection& section, double length, const ElementInput& in, ElementOutput& out) {
  Terms parts;
  read_parts(in.position, parts.at);
  if (in.velocity != nullptr) read_parts(in.velocity, parts.rate);
  const double per[kParts] = {1 / length, 1, 1};  // of first derivatives; second ones: once more 1 / length
  double d[kParts], dd[kParts];
  for (std::size_t k = 0; k < 5; ++k) {
    for (int p = 0; p < kParts; ++p) d[p] = per[p] * kAxialShapes.d[k][p];
    if (!add_axial<kTangent>(d, Weights(length * kAxialShapes.weight[k] * section.axial, in), parts)) return false;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    for (int p = 0; p < kParts; ++p) {
      d[p] = per[p] * kBendingShapes.d[k][p];
      dd[p] = per[p] * kBendingShapes.dd[k][p] / length;
    }
    const Weights weights(length * kBendingShapes.weight[k] * section.bending, in);
    if (!add_bending<kTangent>(d, dd, weights, parts)) return false;
  }
  out.energy = parts.energy;
  for (int a = 0; a < kVertices; ++a)
    for (int i = 0; i < 3; ++i) out.force[3 * a + i] = kSign[a] * parts.force[kPartOf[a]].x[i];
  if constexpr (kTangent)
    for (int b = 0; b < kVertices; ++b)
      for (int j = 0; j < 3; ++j)
        for (int a = 0; a < kVertices; ++a)
          for (int i = 0; i < 3; ++i)
            out.tangent[(3 * b + j) * kCableDofs + 3 * a + i] =
                kSign[a] * kSign[b] * parts.tangent[kPartOf[b]][kPartOf[a]].m[j][i];
  return true;
}

bool evaluate_force(const CableSection& s, double length, const ElementInput& in, ElementOutput& out) {
  return evaluate<false>(s, length, in, out);
}
bool evaluate_tangent(const CableSection& s, double length, const ElementInput& in, ElementOutput& out) {
  return evaluate<true>(s, length, in, out);
}

constexpr int kNodes = 4;
constexpr int kShellDofs = 24;

/// The transposed map, for forces: f_r = f_bottom + f_top, f_d = half (f_top - f_bottom).
void from_hexahedron(const double* hex, double half, double* shell) {
  for (int a = 0; a < kNodes; ++a)
    for (int i = 0; i < 3; ++i) {
      const double bottom = hex[3 * a + i], top = hex[3 * (a + kNodes) + i];
      shell[6 * a + i] = bottom + top;
      shell[6 * a + 3 + i] = half * (top - bottom);
    }
}

}  // namespace

bool evaluate_cable(const CableSection& section, double length, const ElementInput& in, ElementOutput& out) {
  return out.tangent == nullptr ? evaluate_force(section, length, in, out) : evaluate_tangent(section, length, in, out);
}

bool evaluate_shell(const Material& material, double thickness, const ElementInput& in, ElementOutput& out) {
  const double half = 0.5 * thickness;
  double reference[kShellDofs], position[kShellDofs], velocity[kShellDofs], force[kShellDofs],
      tangent[kShellDofs * kShellDofs];
  shell_to_hexahedron(in.reference, thickness, reference);
  shell_to_hexahedron(in.position, thickness, position);
  if (in.velocity != nullptr) shell_to_hexahedron(in.velocity, thickness, velocity);
  ElementInput hex = in;
  hex.reference = reference;
  hex.position = position;
  hex.velocity = in.velocity == nullptr ? nullptr : velocity;
  ElementOutput result{force, out.tangent == nullptr ? nullptr : tangent, 0};
  if (!oracle::evaluate_hex8(Hex8Formulation::shell, material, hex, result)) return false;
  out.energy = result.energy;
  from_hexahedron(force, half, out.force);
  if (out.tangent == nullptr) return true;
  double rows[kShellDofs * kShellDofs];  // rows of the tangent in shell coordinates, columns in those of the hexahedron
  for (int col = 0; col < kShellDofs; ++col) from_hexahedron(tangent + col * kShellDofs, half, rows + col * kShellDofs);
  for (int row = 0; row < kShellDofs; ++row) {
    double line[kShellDofs], turned[kShellDofs];
    for (int col = 0; col < kShellDofs; ++col) line[col] = rows[col * kShellDofs + row];
    from_hexahedron(line, half, turned);
    for (int col = 0; col < kShellDofs; ++col) out.tangent[col * kShellDofs + row] = turned[col];
  }
  return true;
}

}  // namespace espalier::dynamics::oracle
