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

/// The sum over strains e_s of a point with energy (1/2) sum_s D_s (e_s - e0_s)^2 and viscous stress beta D_s de_s/dt,
/// by the variables z of the strains: gradient sum_s sigma_s e_s' with sigma_s = D_s (e_s - e0_s + beta e_s' . dz/dt).
template <int kN>
struct StrainSum {
  double gradient[kN] = {};
  double hessian[kN][kN] = {};  ///< wq (D e' e'^T + sigma e'' + beta D e' (e'' dz/dt)^T) + wv beta D e' e'^T
  double viscous[kN][kN] = {};  ///< wq beta D e' e'^T: what multiplies (z'' dq/dt)^T where z is not linear in q
};

/// The part of the rates in the tangent, for one strain.
template <int kN>
ESPALIER_INLINE void add_viscous(const Jet<kN>& e, double weight, const double (&rate)[kN], StrainSum<kN>& sum) {
  double bend[kN];  // e'' dz/dt
  for (int i = 0; i < kN; ++i) {
    bend[i] = 0;
    for (int j = 0; j < kN; ++j) bend[i] += e.h[i][j] * rate[j];
  }
  for (int i = 0; i < kN; ++i)
    for (int j = 0; j < kN; ++j) {
      sum.hessian[i][j] += weight * e.g[i] * bend[j];
      sum.viscous[i][j] += weight * e.g[i] * e.g[j];
    }
}

/// @param natural e0_s, the strains of the stress-free state
/// @param stiffness D_s; `weight` multiplies all of them
/// @param rate dz/dt
/// @param energy is added to
template <int kN, int kOrder, int kS>
ESPALIER_INLINE void sum_strains(const Jet<kN, kOrder> (&strains)[kS], const double (&natural)[kS],
                                 const double (&stiffness)[kS], double weight, const double (&rate)[kN],
                                 const ElementInput& in, StrainSum<kN>& sum, double& energy) {
  const double beta = in.damping, wq = in.position_weight;
  for (int s = 0; s < kS; ++s) {
    const Jet<kN, kOrder>& e = strains[s];
    const double d = weight * stiffness[s], elastic = e.v - natural[s];
    double e_rate = 0;
    if (beta != 0)
      for (int i = 0; i < kN; ++i) e_rate += e.g[i] * rate[i];
    const double sigma = d * (elastic + beta * e_rate);
    energy += 0.5 * d * elastic * elastic;
    for (int i = 0; i < kN; ++i) sum.gradient[i] += sigma * e.g[i];
    if constexpr (kOrder > 1) {
      const double plain = d * (wq + beta * in.velocity_weight), curved = wq * sigma;
      for (int i = 0; i < kN; ++i) {
        const double left = plain * e.g[i];
        for (int j = 0; j < kN; ++j) sum.hessian[i][j] += left * e.g[j] + curved * e.h[i][j];
      }
      if (beta != 0) add_viscous(e, wq * d * beta, rate, sum);
    }
  }
}

/// Adds the contribution of one point whose strains are functions of point vectors y: forces and, where the strains
/// carry second derivatives, the tangent.
template <int kPv, int kV, int kS, int kOrder>
ESPALIER_INLINE void add_line_point(const PointVectors<kPv, kV>& vectors, const Jet<3 * kPv, kOrder> (&strains)[kS],
                                    const double (&natural)[kS], const double (&stiffness)[kS], double weight,
                                    const ElementInput& in, ElementOutput& out) {
  constexpr int kN = 3 * kPv;
  double rate[kN] = {};
  if (in.damping != 0 && in.velocity != nullptr) vectors.evaluate(in.velocity, rate);
  StrainSum<kN> sum;
  sum_strains(strains, natural, stiffness, weight, rate, in, sum, out.energy);
  for (int a = 0; a < kV; ++a)
    for (int p = 0; p < kPv; ++p)
      for (int i = 0; i < 3; ++i) out.force[3 * a + i] += vectors.c[p][a] * sum.gradient[3 * p + i];
  if constexpr (kOrder > 1)
    for (int b = 0; b < kV; ++b)
      for (int j = 0; j < 3; ++j) {
        double column[kN] = {};
        for (int p = 0; p < kPv; ++p)
          for (int i = 0; i < kN; ++i) column[i] += vectors.c[p][b] * sum.hessian[i][3 * p + j];
        for (int a = 0; a < kV; ++a)
          for (int p = 0; p < kPv; ++p)
            for (int i = 0; i < 3; ++i)
              out.tangent[(3 * b + j) * 3 * kV + 3 * a + i] += vectors.c[p][a] * column[3 * p + i];
      }
}

}  // namespace espalier::dynamics
