/// \file
/// The sum over one integration point that all line elements share: from generalised strains of a few point vectors
/// to nodal forces and tangent blocks.
#pragma once

#include "dynamics/elements/element.hpp"
#include "dynamics/elements/jet.hpp"

namespace espalier::dynamics {

/// Gauss points on [-1, 1].
struct LinePoint {
  double xi, weight;
};
inline constexpr LinePoint kGauss1[1] = {{0, 2}};
inline constexpr LinePoint kGauss2[2] = {{-0.57735026918962576451, 1}, {0.57735026918962576451, 1}};
inline constexpr LinePoint kGauss3[3] = {
    {-0.77459666924148337704, 5.0 / 9}, {0, 8.0 / 9}, {0.77459666924148337704, 5.0 / 9}};
inline constexpr LinePoint kGauss5[5] = {{-0.90617984593866399280, 0.23692688505618908751},
                                         {-0.53846931010568309104, 0.47862867049936646804},
                                         {0, 0.56888888888888888889},
                                         {0.53846931010568309104, 0.47862867049936646804},
                                         {0.90617984593866399280, 0.23692688505618908751}};

/// Hermite cubics for r1, r1_x, r2, r2_x on an element of length l (derivatives by arc length), and their first and
/// second derivatives by arc length.
struct Hermite {
  double n[4], d[4], dd[4];
  Hermite(double xi, double l) {
    const double s = 0.5 * (1 + xi);
    n[0] = 1 - 3 * s * s + 2 * s * s * s;
    n[1] = l * (s - 2 * s * s + s * s * s);
    n[2] = 3 * s * s - 2 * s * s * s;
    n[3] = l * (s * s * s - s * s);
    d[0] = (6 * s * s - 6 * s) / l;
    d[1] = 1 - 4 * s + 3 * s * s;
    d[2] = -d[0];
    d[3] = 3 * s * s - 2 * s;
    dd[0] = (12 * s - 6) / (l * l);
    dd[1] = (6 * s - 4) / l;
    dd[2] = -dd[0];
    dd[3] = (6 * s - 2) / l;
  }
};

/// kPv point vectors y_p = sum_a c[p][a] x_a of the kV vertices of an element.
template <int kPv, int kV>
struct PointVectors {
  double c[kPv][kV] = {};

  ESPALIER_INLINE void evaluate(const double* x, double (&y)[3 * kPv]) const {
    for (int p = 0; p < kPv; ++p)
      for (int i = 0; i < 3; ++i) {
        y[3 * p + i] = 0;
        for (int a = 0; a < kV; ++a) y[3 * p + i] += c[p][a] * x[3 * a + i];
      }
  }
};

/// Adds weight * the contribution of one point with energy (1/2) sum_s D_s (e_s - e0_s)^2 and viscous stress
/// beta D_s de_s/dt. f = sum_s sigma_s e_s', with sigma_s = D_s (e_s - e0_s + beta e_s' . dy/dt), and
/// df/dq = D e' e'^T + sigma e'' + beta D e' (e'' dy/dt)^T, df/dv = beta D e' e'^T, primes by the point vectors y.
/// @param strains jets of the strains e_s over the 3 kPv components of the point vectors
/// @param natural e0_s, the strains of the stress-free state
template <int kPv, int kV, int kS>
ESPALIER_INLINE void add_line_point(const PointVectors<kPv, kV>& vectors, const Jet<3 * kPv> (&strains)[kS],
                                    const double (&natural)[kS], const double (&stiffness)[kS], double weight,
                                    const ElementInput& in, ElementOutput& out) {
  constexpr int kN = 3 * kPv;
  double rate[kN] = {}, gradient[kN] = {}, hessian[kN][kN] = {};
  const double beta = in.damping;
  if (beta != 0 && in.velocity != nullptr) vectors.evaluate(in.velocity, rate);
  for (int s = 0; s < kS; ++s) {
    const Jet<kN>& e = strains[s];
    const double d = weight * stiffness[s];
    if (d == 0) continue;
    const double elastic = e.v - natural[s];
    double e_rate = 0, bend[kN];
    for (int i = 0; i < kN; ++i) e_rate += e.g[i] * rate[i];
    for (int i = 0; i < kN; ++i) {
      bend[i] = 0;
      for (int j = 0; j < kN; ++j) bend[i] += e.h[i][j] * rate[j];
    }
    const double sigma = d * (elastic + beta * e_rate);
    out.energy += 0.5 * d * elastic * elastic;
    const double wq = in.position_weight, wb = d * (wq + beta * in.velocity_weight);
    for (int i = 0; i < kN; ++i) gradient[i] += sigma * e.g[i];
    for (int i = 0; i < kN; ++i)
      for (int j = 0; j < kN; ++j)
        hessian[i][j] += e.g[i] * (wb * e.g[j] + wq * d * beta * bend[j]) + wq * sigma * e.h[i][j];
  }
  for (int a = 0; a < kV; ++a)
    for (int p = 0; p < kPv; ++p)
      for (int i = 0; i < 3; ++i) out.force[3 * a + i] += vectors.c[p][a] * gradient[3 * p + i];
  if (out.tangent == nullptr) return;
  for (int b = 0; b < kV; ++b)
    for (int j = 0; j < 3; ++j) {
      double column[kN] = {};
      for (int p = 0; p < kPv; ++p)
        for (int i = 0; i < kN; ++i) column[i] += vectors.c[p][b] * hessian[i][3 * p + j];
      for (int a = 0; a < kV; ++a)
        for (int p = 0; p < kPv; ++p)
          for (int i = 0; i < 3; ++i)
            out.tangent[(3 * b + j) * 3 * kV + 3 * a + i] += vectors.c[p][a] * column[3 * p + i];
    }
}

}  // namespace espalier::dynamics
