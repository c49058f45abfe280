/// \file
/// Isotropic hyperelastic materials, as the response of one point to its deformation gradient.
#pragma once

#include <cmath>

#include "base/named.hpp"

namespace espalier::dynamics {

enum class SolidLaw {
  st_venant_kirchhoff,  ///< W = lambda/2 tr(E)^2 + mu E:E; large rotations, moderate strains
  neo_hookean,          ///< W = mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)^2 (Simo and Pister 1984); large strains
};
inline constexpr base::Named<SolidLaw> kSolidLaws[] = {{"st-venant-kirchhoff", SolidLaw::st_venant_kirchhoff},
                                                       {"neo-hookean", SolidLaw::neo_hookean}};

struct Material {
  SolidLaw law = SolidLaw::st_venant_kirchhoff;
  double young = 0;    ///< Young's modulus at zero strain
  double poisson = 0;  ///< Poisson's ratio at zero strain, in (-1, 1/2)
  double density = 0;  ///< mass per reference volume
  [[nodiscard]] double lambda() const { return young * poisson / ((1 + poisson) * (1 - 2 * poisson)); }
  [[nodiscard]] double mu() const { return young / (2 * (1 + poisson)); }
};

/// @throws std::invalid_argument unless young > 0, -1 < poisson < 1/2 and density > 0
void check_material(const Material& material);

using Mat33 = double[3][3];

/// Stress and tangent of one point, in the form that keeps the element tangent free of fourth-order tensors. With
/// G_a = dN_a/dX, u_a = U G_a and w_a = W G_a the 3 x 3 block of the pair (a, b) is
///   c1 u_a w_b^T + c2 u_b w_a^T + (G_a . H G_b) I + (G_a . G_b) M.
/// St. Venant-Kirchhoff: U = F, c1 = lambda, c2 = mu, H = S, M = mu F F^T. Neo-Hookean: U = F^-T, c1 = lambda,
/// c2 = mu - lambda ln J, H = mu I, M = 0. Both follow from differentiating the first Piola stress P(F).
struct PointResponse {
  Mat33 p;  ///< first Piola-Kirchhoff stress, force = sum P G_a
  Mat33 u, w, h, m;
  double c1 = 0, c2 = 0;
  double energy = 0;  ///< per reference volume
};

/// Weights of the tangent (see ElementInput).
struct PointWeights {
  double position = 1, velocity = 0, damping = 0;
};

/// c = a b
inline void multiply(const Mat33& a, const Mat33& b, Mat33& c) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) c[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
}

inline double determinant(const Mat33& a) {
  return a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) - a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
         a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
}

/// inverse = a^-1; @return det a. Undefined entries when that is 0.
inline double invert(const Mat33& a, Mat33& inverse) {
  const double det = determinant(a);
  const double s = 1 / det;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      inverse[j][i] = s * (a[i1][j1] * a[i2][j2] - a[i1][j2] * a[i2][j1]);
    }
  return det;
}

/// det(I + h) - 1 without the cancellation of computing the determinant first.
inline double volume_change(const Mat33& h) {
  const double second = h[0][0] * h[1][1] - h[0][1] * h[1][0] + h[1][1] * h[2][2] - h[1][2] * h[2][1] +
                        h[2][2] * h[0][0] - h[2][0] * h[0][2];
  return h[0][0] + h[1][1] + h[2][2] + second + determinant(h);
}

/// St. Venant-Kirchhoff with stress S(E + damping * dE/dt), E from the displacement gradient `grad`, dE/dt from the
/// velocity gradient `rate`. The strain energy counts E alone. With `elastic` = 0 only the rate part remains (the
/// damping of a material whose elastic part is another law).
inline void respond_svk(const Mat33& grad, const Mat33& rate, double lambda, double mu, double elastic,
                        const PointWeights& weights, PointResponse& out) {
  Mat33 f, s;
  double trace_e = 0, trace = 0, square = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) f[i][j] = grad[i][j] + (i == j ? 1.0 : 0.0);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double e = grad[i][j] + grad[j][i], r = 0;
      for (int k = 0; k < 3; ++k) {
        e += grad[k][i] * grad[k][j];
        r += f[k][i] * rate[k][j] + rate[k][i] * f[k][j];
      }
      e *= 0.5 * elastic;
      const double total = e + 0.5 * weights.damping * r;
      square += e * e;
      if (i == j) {
        trace_e += e;
        trace += total;
      }
      s[i][j] = 2 * mu * total;
    }
  for (int i = 0; i < 3; ++i) s[i][i] += lambda * trace;
  multiply(f, s, out.p);
  const double wf = elastic * weights.position + weights.damping * weights.velocity;
  const double wr = weights.position * weights.damping;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      out.u[i][j] = f[i][j];
      out.w[i][j] = wf * f[i][j] + wr * rate[i][j];
      out.h[i][j] = weights.position * s[i][j];
    }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      out.m[i][j] = mu * (f[i][0] * out.w[j][0] + f[i][1] * out.w[j][1] + f[i][2] * out.w[j][2]);
  out.c1 = lambda;
  out.c2 = mu;
  out.energy = 0.5 * lambda * trace_e * trace_e + mu * square;
}

/// Compressible neo-Hookean, elastic part only. @return false when det F <= 0 (output undefined)
inline bool respond_neo_hookean(const Mat33& grad, double lambda, double mu, const PointWeights& weights,
                                PointResponse& out) {
  const double dj = volume_change(grad);
  if (!(dj > -1)) return false;
  const double log_j = std::log1p(dj);
  Mat33 f, inverse;
  double trace_e = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      f[i][j] = grad[i][j] + (i == j ? 1.0 : 0.0);
      trace_e += 0.5 * grad[i][j] * grad[i][j] + (i == j ? grad[i][j] : 0.0);
    }
  invert(f, inverse);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      out.p[i][j] = mu * f[i][j] + (lambda * log_j - mu) * inverse[j][i];
      out.u[i][j] = inverse[j][i];
      out.w[i][j] = weights.position * inverse[j][i];
      out.h[i][j] = i == j ? weights.position * mu : 0.0;
      out.m[i][j] = 0;
    }
  out.c1 = lambda;
  out.c2 = mu - lambda * log_j;
  out.energy = mu * (trace_e - log_j) + 0.5 * lambda * log_j * log_j;
  return true;
}

}  // namespace espalier::dynamics
