/// \file
/// Rotations for beams as jets: the frame of a cross-section, small rotations from it, unit quaternions.
#pragma once

#include <cmath>

#include "dynamics/elements/jet.hpp"
#include "dynamics/elements/material.hpp"

namespace espalier::dynamics {

/// Orthonormal frame of a cross-section: t1 along r_y x r_z; t2, t3 the polar rotation of r_y and r_z, so that
/// t2 . r_z = t3 . r_y. This is the rotation that joints and loads turn (make_beam_frame()).
template <int kN, int kOrder>
struct SectionFrame {
  Jet3<kN, kOrder> t[3];
  bool ok = false;  ///< false where r_y and r_z are parallel or zero
};

template <int kN, int kOrder>
ESPALIER_INLINE SectionFrame<kN, kOrder> section_frame(const Jet3<kN, kOrder>& ry, const Jet3<kN, kOrder>& rz) {
  SectionFrame<kN, kOrder> f;
  const Jet3<kN, kOrder> n = cross(ry, rz);
  const Jet<kN, kOrder> nn = dot(n, n);
  if (!(nn.v > 0)) return f;
  f.t[0] = inverse(sqrt(nn)) * n;
  // t2 lies along r_y + r_z x t1: its product with t3 = t1 x t2 is t3 . r_y - t2 . r_z.
  const Jet3<kN, kOrder> sum = ry + cross(rz, f.t[0]);
  const Jet<kN, kOrder> ss = dot(sum, sum);
  if (!(ss.v > 0)) return f;
  f.t[1] = inverse(sqrt(ss)) * sum;
  f.t[2] = cross(f.t[0], f.t[1]);
  f.ok = true;
  return f;
}

/// The values of a frame; columns t1, t2, t3.
template <int kN, int kOrder>
ESPALIER_INLINE void frame_values(const SectionFrame<kN, kOrder>& f, Mat33& r) {
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) r[i][k] = f.t[k].x[i].v;
}

/// eps with R = R0 exp(eps) near R = R0, R0 the frame's own value: exact in value (0), first and second derivative,
/// since (R0^T R - R^T R0) / 2 = eps + O(eps^3).
template <int kN, int kOrder>
ESPALIER_INLINE Jet3<kN, kOrder> small_rotation(const SectionFrame<kN, kOrder>& f) {
  Jet3<kN, kOrder> eps;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    for (int c = 0; c < 3; ++c) {
      eps.x[i].add(f.t[j].x[c], 0.5 * f.t[k].x[c].v);
      eps.x[i].add(f.t[k].x[c], -0.5 * f.t[j].x[c].v);
    }
  }
  return eps;
}

/// w + v as a quaternion.
template <int kN, int kOrder>
struct JetQuaternion {
  Jet<kN, kOrder> w;
  Jet3<kN, kOrder> v;
};

/// The unit quaternion [w, x, y, z] of a rotation matrix (Shepperd 1978: divide by the largest component).
inline void quaternion_of(const Mat33& r, double (&q)[4]) {
  const double square[4] = {1 + r[0][0] + r[1][1] + r[2][2], 1 + r[0][0] - r[1][1] - r[2][2],
                            1 - r[0][0] + r[1][1] - r[2][2], 1 - r[0][0] - r[1][1] + r[2][2]};
  int most = 0;
  for (int k = 1; k < 4; ++k)
    if (square[k] > square[most]) most = k;
  const double half = 0.5 / std::sqrt(square[most]);  // 1 / (4 |q_most|)
  const double skew[3] = {r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]};
  q[most] = square[most] * half;
  for (int i = 0; i < 3; ++i)
    if (most == 0) q[1 + i] = skew[i] * half;
  if (most == 0) return;
  const int a = most - 1;
  q[0] = skew[a] * half;
  for (int i = 0; i < 3; ++i)
    if (i != a) q[1 + i] = (r[i][a] + r[a][i]) * half;
}

/// q exp(eps / 2) with the small rotation eps in variables `first` .. first + 2, exact to second order at eps = 0:
/// exp(eps / 2) = [1 - eps^2 / 8, eps / 2].
template <int kN, int kOrder>
ESPALIER_INLINE JetQuaternion<kN, kOrder> turned_quaternion(const double (&q)[4], int first) {
  JetQuaternion<kN, kOrder> p;
  Jet<kN, kOrder>* parts[4] = {&p.w, &p.v.x[0], &p.v.x[1], &p.v.x[2]};
  const double by[3][4] = {{-q[1], q[0], q[3], -q[2]}, {-q[2], -q[3], q[0], q[1]}, {-q[3], q[2], -q[1], q[0]}};
  for (int c = 0; c < 4; ++c) {
    parts[c]->v = q[c];
    for (int i = 0; i < 3; ++i) {
      if constexpr (kOrder > 0) parts[c]->g[first + i] = 0.5 * by[i][c];
      if constexpr (kOrder > 1) parts[c]->h[first + i][first + i] = -0.25 * q[c];
    }
  }
  return p;
}

/// conj(a) b
template <int kN, int kOrder>
ESPALIER_INLINE JetQuaternion<kN, kOrder> relative(const JetQuaternion<kN, kOrder>& a,
                                                   const JetQuaternion<kN, kOrder>& b) {
  return {a.w * b.w + dot(a.v, b.v), a.w * b.v - b.w * a.v - cross(a.v, b.v)};
}

/// R^T x, R the rotation of the unit quaternion p: x - 2 w v x x + 2 v x (v x x).
template <int kN, int kOrder>
ESPALIER_INLINE Jet3<kN, kOrder> turned_back(const JetQuaternion<kN, kOrder>& p, const Jet3<kN, kOrder>& x) {
  const Jet3<kN, kOrder> vx = cross(p.v, x);
  return x + 2.0 * (cross(p.v, vx) - p.w * vx);
}

/// g(w) = theta / sin(theta / 2), w = cos(theta / 2), 0 <= theta < 2 pi, and its first three derivatives by w.
/// g' = (w g - 2) / (1 - w^2) and its derivatives; near w = 1, where they cancel, g = sum c_k (1 - w)^k with c_0 = 2,
/// c_k = c_(k-1) k / (2 k + 1), from the same equation.
ESPALIER_INLINE void half_angle_ratio(double w, double (&g)[4]) {
  if (w < 0.5) {
    const double s = 1 - w * w;
    g[0] = 2 * std::acos(w) / std::sqrt(s);
    g[1] = (w * g[0] - 2) / s;
    g[2] = (g[0] + 3 * w * g[1]) / s;
    g[3] = (4 * g[1] + 5 * w * g[2]) / s;
    return;
  }
  const double u = 1 - w;          // at most 1/2: a term is less than u / 2 of the one before
  double power[4] = {2, 0, 0, 0};  // c_k u^k and its derivatives by u
  for (double& sum : g) sum = 0;
  for (int k = 0; k < 40; ++k) {
    for (int d = 0; d < 4; ++d) g[d] += power[d];
    if (k > 3 && power[3] < 1e-17 * g[3]) break;
    const double ratio = (k + 1.0) / (2 * k + 3.0);
    for (int d = 3; d > 0; --d) power[d] = ratio * (u * power[d] + d * power[d - 1]);
    power[0] *= ratio * u;
  }
  g[1] = -g[1];
  g[3] = -g[3];
}

}  // namespace espalier::dynamics
