// Strains of the eight-node hexahedron at its integration points: sampled in covariant components, tied where a shell
// wants it, enhanced by modes, in Cartesian components. For oracle_hex8.cpp alone.
#pragma once

#include <algorithm>

#include "dynamics/elements/dispatch.hpp"
#include "dynamics/elements/hex8_kinematics.hpp"
#include "dynamics/elements/strain_material.hpp"

namespace espalier::dynamics::oracle {

using namespace hex8;  // NOLINT(google-build-using-namespace): its tables

inline constexpr int kMaxModes = 9;
// Strain components in the order 11 22 33 12 23 13, shear as engineering strain (twice the tensor component).
inline constexpr int kRow[6] = {0, 1, 2, 0, 1, 0};
inline constexpr int kCol[6] = {0, 1, 2, 1, 2, 2};

using Row = double[kDofs];

/// Covariant basis c[i][d] = sum_a x_a,i dN_a/dxi_d of a nodal field.
ESPALIER_INLINE void basis(const Gradients& dn, const double* x, Mat33& c) {
  for (int i = 0; i < 3; ++i)
    for (int d = 0; d < 3; ++d) {
      c[i][d] = 0;
      for (int a = 0; a < kNodes; ++a) c[i][d] += x[3 * a + i] * dn[d][a];
    }
}

/// Covariant strain, its rate, and their rows of B at one point for one component. Functions with kRows = false leave
/// the rows as they are: most of the work, where strains alone are wanted.
struct Sample {
  double strain, rate;
  Row b, b_rate;
};

/// Bases of one sampling point: reference, displacement, velocity.
struct Bases {
  Mat33 reference, displacement, current, velocity;
};

ESPALIER_INLINE void fill_bases(const Gradients& dn, const double* x0, const double* u, const double* v, Bases& g) {
  basis(dn, x0, g.reference);
  basis(dn, u, g.displacement);
  basis(dn, v, g.velocity);
  for (int i = 0; i < 3; ++i)
    for (int d = 0; d < 3; ++d) g.current[i][d] = g.reference[i][d] + g.displacement[i][d];
}

/// E_ij = (g_i . g_j - G_i . G_j) / 2, written with the displacement so that small strains keep their digits.
template <bool kRows = true>
ESPALIER_INLINE void sample(const Gradients& dn, const Bases& g, int component, Sample& s) {
  const int p = kRow[component], r = kCol[component];
  const double scale = p == r ? 0.5 : 1.0;
  s.strain = s.rate = 0;
  for (int i = 0; i < 3; ++i) {
    s.strain += g.reference[i][p] * g.displacement[i][r] + g.displacement[i][p] * g.reference[i][r] +
                g.displacement[i][p] * g.displacement[i][r];
    s.rate += g.current[i][p] * g.velocity[i][r] + g.velocity[i][p] * g.current[i][r];
    for (int a = 0; kRows && a < kNodes; ++a) {
      s.b[3 * a + i] = scale * (dn[p][a] * g.current[i][r] + dn[r][a] * g.current[i][p]);
      s.b_rate[3 * a + i] = scale * (dn[p][a] * g.velocity[i][r] + dn[r][a] * g.velocity[i][p]);
    }
  }
  s.strain *= scale;
  s.rate *= scale;
}

/// T with E_cartesian = T E_covariant in the engineering order above; A = (dX/dxi)^-1, E = A^T E_cov A.
ESPALIER_INLINE void strain_transform(const Mat33& a, double (&t)[6][6]) {
  for (int m = 0; m < 6; ++m) {
    const int i = kRow[m], j = kCol[m];
    const double twice = i == j ? 1 : 2;
    for (int n = 0; n < 6; ++n) {
      const int p = kRow[n], r = kCol[n];
      t[m][n] = p == r ? twice * a[p][i] * a[p][j] : 0.5 * twice * (a[p][i] * a[r][j] + a[r][i] * a[p][j]);
    }
  }
}

/// Everything about one integration point that the formulations need.
struct PointData {
  double volume;  // weight * det
  double t[6][6];
  double strain[6], rate[6];
  double b[6][kDofs], b_rate[6][kDofs];
  double m[6][kMaxModes];  // enhanced modes, Cartesian
};

struct Element {
  PointData point[kPoints];
  double tying_force[8];  // sum of weight * covariant stress on each tied component
  int modes = 0;
  double alpha[kMaxModes] = {};
};

inline constexpr Mode kEnhanced[kEnhancedModes] = {enhanced_mode(0), enhanced_mode(1), enhanced_mode(2),
                                                   enhanced_mode(3), enhanced_mode(4), enhanced_mode(5),
                                                   enhanced_mode(6), enhanced_mode(7), enhanced_mode(8)};
inline constexpr Mode kShell[kShellModes] = {shell_mode(0), shell_mode(1), shell_mode(2), shell_mode(3),
                                             shell_mode(4), shell_mode(5), shell_mode(6), shell_mode(7)};

/// M = (det J0 / det J) T0 M_cov(xi): T0 of the centre makes the modes pass the patch test (Simo and Rifai 1990).
ESPALIER_INLINE void fill_modes(const Mode* modes, int count, const double (&t0)[6][6], double scale, const double* xi,
                                PointData& p) {
  for (int k = 0; k < count; ++k) {
    const double value = scale * polynomial(modes[k].polynomial, xi);
    for (int r = 0; r < 6; ++r) p.m[r][k] = t0[r][modes[k].component] * value;
  }
}

template <bool kRows = true>
ESPALIER_INLINE void to_cartesian(const double (&t)[6][6], const Sample (&cov)[6], PointData& p) {
  for (int m = 0; m < 6; ++m) {
    p.strain[m] = p.rate[m] = 0;
    for (int d = 0; kRows && d < kDofs; ++d) p.b[m][d] = p.b_rate[m][d] = 0;
    for (int n = 0; n < 6; ++n) {
      p.strain[m] += t[m][n] * cov[n].strain;
      p.rate[m] += t[m][n] * cov[n].rate;
      for (int d = 0; kRows && d < kDofs; ++d) {
        p.b[m][d] += t[m][n] * cov[n].b[d];
        p.b_rate[m][d] += t[m][n] * cov[n].b_rate[d];
      }
    }
  }
}

/// Replaces the tied components by their interpolation.
template <bool kRows = true>
ESPALIER_INLINE void tie(const double (&weight)[8], const Sample (&tying)[8], Sample (&cov)[6]) {
  for (const int component : {2, 4, 5}) cov[component] = Sample{};
  for (int t = 0; t < 8; ++t) {
    Sample& c = cov[kTying[t].component];
    if (weight[t] == 0) continue;
    c.strain += weight[t] * tying[t].strain;
    c.rate += weight[t] * tying[t].rate;
    for (int d = 0; kRows && d < kDofs; ++d) {
      c.b[d] += weight[t] * tying[t].b[d];
      c.b_rate[d] += weight[t] * tying[t].b_rate[d];
    }
  }
}

}  // namespace espalier::dynamics::oracle
