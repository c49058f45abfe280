/// \file
/// The materials of material.hpp as functions of the Green-Lagrange strain, for elements that assume strains.
#pragma once

#include <cmath>

#include "dynamics/elements/material.hpp"

namespace espalier::dynamics {

/// Second Piola-Kirchhoff stress and its derivative; order 11 22 33 12 23 13, strains as engineering shear.
struct StrainStress {
  double s[6];
  double c[6][6];
  double energy;  ///< per reference volume
};

/// The law S(E). C = I + 2 E, J = sqrt(det C).
class StrainMaterial {
 public:
  explicit StrainMaterial(const Material& m)
      : linear_(m.law == SolidLaw::st_venant_kirchhoff), lambda_(m.lambda()), mu_(m.mu()) {}
  [[nodiscard]] bool linear() const { return linear_; }

  /// @return false when det C <= 0 (output undefined)
  [[nodiscard]] bool stress(const double (&e)[6], StrainStress& out) const {
    return linear_ ? st_venant_kirchhoff(e, out) : neo_hookean(e, out);
  }

 private:
  bool st_venant_kirchhoff(const double (&e)[6], StrainStress& out) const {
    const double trace = e[0] + e[1] + e[2];
    for (int m = 0; m < 6; ++m)
      for (int n = 0; n < 6; ++n)
        out.c[m][n] = (m < 3 && n < 3 ? lambda_ : 0.0) + (m == n ? (m < 3 ? 2 * mu_ : mu_) : 0.0);
    out.energy = 0;
    for (int m = 0; m < 6; ++m) {
      out.s[m] = m < 3 ? lambda_ * trace + 2 * mu_ * e[m] : mu_ * e[m];
      out.energy += 0.5 * out.s[m] * e[m];
    }
    return true;
  }

  /// S = mu (I - C^-1) + lambda ln J C^-1, dS/dE = lambda C^-1 x C^-1 + 2 (mu - lambda ln J) I_(C^-1).
  bool neo_hookean(const double (&e)[6], StrainStress& out) const {
    static constexpr int kRow[6] = {0, 1, 2, 0, 1, 0};
    static constexpr int kCol[6] = {0, 1, 2, 1, 2, 2};
    Mat33 twice, c, inverse;
    for (int m = 0; m < 6; ++m) twice[kRow[m]][kCol[m]] = twice[kCol[m]][kRow[m]] = m < 3 ? 2 * e[m] : e[m];
    const double dj2 = volume_change(twice);  // det C - 1
    if (!(dj2 > -1)) return false;
    const double log_j = 0.5 * std::log1p(dj2);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) c[i][j] = twice[i][j] + (i == j ? 1.0 : 0.0);
    invert(c, inverse);
    // I - C^-1 = C^-1 (C - I): no cancellation at small strain
    Mat33 difference;
    multiply(inverse, twice, difference);
    const double mu2 = mu_ - lambda_ * log_j;
    for (int m = 0; m < 6; ++m) {
      const int i = kRow[m], j = kCol[m];
      out.s[m] = mu_ * 0.5 * (difference[i][j] + difference[j][i]) + lambda_ * log_j * inverse[i][j];
      for (int n = 0; n < 6; ++n) {
        const int k = kRow[n], l = kCol[n];
        out.c[m][n] = lambda_ * inverse[i][j] * inverse[k][l] +
                      mu2 * (inverse[i][k] * inverse[j][l] + inverse[i][l] * inverse[j][k]);
      }
    }
    out.energy = mu_ * (e[0] + e[1] + e[2] - log_j) + 0.5 * lambda_ * log_j * log_j;
    return true;
  }

  bool linear_;
  double lambda_, mu_;
};

}  // namespace espalier::dynamics
