/// \file
/// The twelve strains of a beam element, as functions of what deforms it.
///
/// A node has a position r, the slope g = r' by arc length, and the rotation R = [t1 t2 t3] of its section. Reissner's
/// strains are Gamma = R^T r' and kappa, [kappa]_x = R^T R' (Simo 1985). Six rigid motions taken away, an element has
/// twelve numbers that deform it, and as many are the strains here: along the element Gamma_1 is quadratic, Gamma_2,
/// Gamma_3, kappa_2 and kappa_3 are linear, kappa_1 is constant, each a sum of Legendre polynomials in xi = -1 .. 1.
///
/// With phi = log(R_1^T R_2) and the mean rotation R_m = R_1 exp(phi / 2), the sections are taken as
/// R(s) = R_m exp(s phi + (1 - 4 s^2) b), s = -1/2 .. 1/2; b, across the axis, is the part of the bending that is not
/// uniform. The chord d = R_m^T (r_2 - r_1) is the integral of R_m^T R Gamma over the length; to second order in b
/// and in the change of Gamma
///   d / L = S u + phi x (Gamma_b - Gamma_a) / 12,   u = Gamma + 2/3 b x Gamma - 4/15 |b|^2 Gamma,
///   S = integral of exp(s phi) ds = n n^T + sin(theta/2) / (theta/2) (I - n n^T),  phi = theta n,
/// where Gamma is the mean. It gives b from the shears at the nodes, where r' is known, and the mean of Gamma_1. The
/// mean curvature is (phi + 2/3 phi x b) / L, its slope -4 b / L per xi.
///
/// Torsion may change along the element too: b has a part b_1 along the axis, which no coordinate of a node gives. It
/// takes the value with the least energy (Simo and Rifai's enhanced strains, 1990, condensed by hand): kappa_1 gets the
/// slope -4 b_1 / L, the mean of kappa_2 and kappa_3 2/3 b_1 (phi_3, -phi_2) / L. With c = sum_s D_s e_s^1 (e_s -
/// e_s^0), k = sum_s D_s (e_s^1)^2 over the strains e_s^1 that b_1 = 1 makes, the energy falls by c^2 / (2 k): a strain
/// c k^(-1/2) of stiffness -1. The sum stays a least value of squares, so it is never negative.
///
/// Where strains are constant (arcs and helices of any size, below a full turn of an element) all of this is exact:
/// an element under end moments is exact, and no strain locks another. Otherwise the error of nodes falls with L^4.
/// Strains do not change under a rigid motion, since they are made of R_1^T R_2, R_m^T (r_2 - r_1) and R_i^T g_i alone.
/// The exact interpolation of constant strains is that of Borri and Bottasso (1994), "An intrinsic beam model based on
/// a helicoidal approximation".
#pragma once

#include "dynamics/elements/beam_frame.hpp"

namespace espalier::dynamics {

inline constexpr int kBeamStrains = 12;
/// Small rotations of the nodes (in their own frames), r_2 - r_1, slopes of the nodes (global): 15, and one that is
/// not used, so that rows fill registers.
inline constexpr int kBeamVariables = 16;
enum BeamVariable { kTurn1 = 0, kTurn2 = 3, kChord = 6, kSlope1 = 9, kSlope2 = 12 };

/// The state of an element: frames of the nodes (columns t1, t2, t3), r_2 - r_1 and slopes.
struct BeamState {
  Mat33 frame[2];
  double chord[3], slope[2][3];
};

namespace beam {

template <int kOrder>
using Number = Jet<kBeamVariables, kOrder>;
template <int kOrder>
using Vector = Jet3<kBeamVariables, kOrder>;
template <int kOrder>
using Rotation = JetQuaternion<kBeamVariables, kOrder>;

template <int kOrder>
ESPALIER_INLINE Vector<kOrder> variables(const double (&x)[3], int first) {
  Vector<kOrder> v;
  for (int i = 0; i < 3; ++i) v.x[i] = Number<kOrder>::variable(x[i], first + i);
  return v;
}

/// Both q and -q stand for the same rotation: whether the element turns by theta < pi or by 2 pi - theta the other way
/// round is told by the chord, which lies along the mean t1 in a bent element. Without bending the smaller angle wins.
/// @return true where the quaternion b is to be taken as -b
inline bool other_way_round(const double (&a)[4], const double (&b)[4], const double* chord) {
  double length = 0, along[2] = {0, 0}, w = 0;
  for (int k = 0; k < 4; ++k) w += a[k] * b[k];
  for (int i = 0; i < 3; ++i) length += chord[i] * chord[i];
  if (std::abs(w) > 0.9 || !(length > 0)) return w < 0;
  for (int way = 0; way < 2; ++way) {
    double m[4], square = 0;
    for (int k = 0; k < 4; ++k) m[k] = a[k] + (way == 0 ? b[k] : -b[k]);
    for (const double c : m) square += c * c;
    const double t1[3] = {m[0] * m[0] + m[1] * m[1] - m[2] * m[2] - m[3] * m[3], 2 * (m[1] * m[2] + m[0] * m[3]),
                          2 * (m[1] * m[3] - m[0] * m[2])};
    for (int i = 0; i < 3; ++i) along[way] += t1[i] * chord[i] / (square * std::sqrt(length));
  }
  return along[0] - along[1] + 2 * w < 0;
}

/// The relative rotation of the nodes and the mean one.
template <int kOrder>
struct Turns {
  Rotation<kOrder> node[2], mean;
  Vector<kOrder> v;              // axis times sin(theta / 2)
  Number<kOrder> ratio, spread;  // theta / sin(theta / 2); (ratio / 2 - 1) / sin^2(theta / 2)
  bool ok = false;
};

template <int kOrder>
ESPALIER_INLINE Turns<kOrder> turns(const BeamState& state) {
  Turns<kOrder> t;
  double q[2][4];
  for (int k = 0; k < 2; ++k) quaternion_of(state.frame[k], q[k]);
  if (other_way_round(q[0], q[1], state.chord))
    for (double& c : q[1]) c = -c;
  for (int k = 0; k < 2; ++k) t.node[k] = turned_quaternion<kBeamVariables, kOrder>(q[k], k == 0 ? kTurn1 : kTurn2);
  const Rotation<kOrder> between = relative(t.node[0], t.node[1]);
  t.v = between.v;
  t.ok = between.w.v > -1 + 1e-9;  // a full turn has no mean
  if (!t.ok) return t;
  Number<kOrder> one = between.w;
  one.v += 1;
  const Number<kOrder> over = inverse(one), scale = sqrt(0.5 * over);  // 1 / |p_1 + p_2| = (2 + 2 w)^(-1/2)
  t.mean = {scale * (t.node[0].w + t.node[1].w), scale * (t.node[0].v + t.node[1].v)};
  double g[4];
  half_angle_ratio(between.w.v, g);
  t.ratio = chain(between.w, g[0], g[1], g[2]);
  // (g - 2) / (2 (1 - w^2)) = (g' + g / (1 + w)) / 2
  t.spread = 0.5 * (chain(between.w, g[1], g[2], g[3]) + over * t.ratio);
  return t;
}

}  // namespace beam

/// Strains in the order of beam_stiffness(), and phi. @return false when the element has turned inside out
template <int kOrder>
ESPALIER_INLINE bool beam_strains(const BeamState& state, double length, Jet<kBeamVariables, kOrder> (&e)[kBeamStrains],
                                  Jet3<kBeamVariables, kOrder>& phi) {
  using Number = beam::Number<kOrder>;
  using Vector = beam::Vector<kOrder>;
  const auto t = beam::turns<kOrder>(state);
  if (!t.ok) return false;
  const Vector gamma1 = turned_back(t.node[0], beam::variables<kOrder>(state.slope[0], kSlope1));
  const Vector gamma2 = turned_back(t.node[1], beam::variables<kOrder>(state.slope[1], kSlope2));
  const Vector mean = 0.5 * (gamma1 + gamma2), half = 0.5 * (gamma2 - gamma1);
  phi = t.ratio * t.v;
  const Vector chord = (1 / length) * turned_back(t.mean, beam::variables<kOrder>(state.chord, kChord));
  const Vector d = chord - (1.0 / 6) * cross(phi, half);
  // S^-1 d = c d - (c - 1) n (n . d), c = (theta / 2) / sin(theta / 2)
  const Vector u = 0.5 * (t.ratio * d) - (t.spread * dot(t.v, d)) * t.v;
  if (!(u.x[0].v > 0)) return false;
  const Number over = inverse(u.x[0]);
  const Number b2 = 1.5 * (over * (mean.x[2] - u.x[2])), b3 = 1.5 * (over * (u.x[1] - mean.x[1]));
  const Number axial =
      u.x[0] + (4.0 / 15) * (u.x[0] * (b2 * b2 + b3 * b3)) - (2.0 / 3) * (b2 * mean.x[2] - b3 * mean.x[1]);
  e[0] = axial;
  e[1] = half.x[0];
  e[2] = mean.x[0] - axial;
  for (int k = 0; k < 2; ++k) {
    e[3 + 2 * k] = mean.x[1 + k];
    e[4 + 2 * k] = half.x[1 + k];
  }
  const double per = 1 / length, third = 2 / (3 * length);
  e[7] = per * phi.x[0] + third * (phi.x[1] * b3 - phi.x[2] * b2);
  e[8] = per * phi.x[1] - third * (phi.x[0] * b3);
  e[9] = -4 * per * b2;
  e[10] = per * phi.x[2] + third * (phi.x[0] * b2);
  e[11] = -4 * per * b3;
  return true;
}

/// The strain of stiffness -1 by which a change of the torsion along the element relieves it (see above).
/// @param torsion, bending_y, bending_z of the section
/// @param natural the strains of the unstressed element
template <int kOrder>
ESPALIER_INLINE Jet<kBeamVariables, kOrder> torsion_relief(const double (&stiffness)[3], double length,
                                                           const Jet<kBeamVariables, kOrder> (&e)[kBeamStrains],
                                                           const double (&natural)[kBeamStrains],
                                                           const Jet3<kBeamVariables, kOrder>& phi) {
  const auto [torsion, bending_y, bending_z] = stiffness;
  const Jet<kBeamVariables, kOrder>&y = phi.x[1], &z = phi.x[2];
  // Times L: the strains of b_1 = 1 are -4 / L (kappa_1, weight L / 3), 2/3 phi_3 / L and -2/3 phi_2 / L (weight L).
  Jet<kBeamVariables, kOrder> k = (4.0 / 9) * (bending_y * (z * z) + bending_z * (y * y));
  k.v += 16.0 / 3 * torsion;
  if (!(k.v > 0)) return {};
  const Jet<kBeamVariables, kOrder> c =
      (2.0 / 3) * (bending_y * (z * (e[8] - natural[8])) - bending_z * (y * (e[10] - natural[10])));
  return std::sqrt(length) * (c * inverse(sqrt(k)));
}

}  // namespace espalier::dynamics
