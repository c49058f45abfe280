#include "matrix/generators/hex8.hpp"

#include <cmath>
#include <cstddef>

namespace espalier::matrix {

namespace {

// Shape functions and their gradients in space at one Gauss point, and the volume that it stands for.
struct GaussPoint {
  std::array<double, 8> shape;
  std::array<std::array<double, 3>, 8> gradient;
  double volume;
};

using Matrix3 = std::array<std::array<double, 3>, 3>;

double invert(const Matrix3& m, Matrix3& inverse) {
  const auto cofactor = [&](std::size_t i, std::size_t k) {
    const std::size_t i1 = (i + 1) % 3, i2 = (i + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
    return m[i1][k1] * m[i2][k2] - m[i1][k2] * m[i2][k1];
  };
  const double det = m[0][0] * cofactor(0, 0) + m[0][1] * cofactor(0, 1) + m[0][2] * cofactor(0, 2);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k) inverse[k][i] = cofactor(i, k) / det;
  return det;
}

// The point-th of the 2 x 2 x 2 Gauss points, on the reference cube [0, 1]^3 (weight 1/8 each).
GaussPoint gauss_point(const HexCorners& corners, std::size_t point) {
  const double offset = 0.5 / std::sqrt(3.0);
  std::array<double, 3> xi{};
  for (std::size_t d = 0; d < 3; ++d) xi[d] = 0.5 + ((point >> d & 1) != 0 ? offset : -offset);
  GaussPoint g{};
  std::array<std::array<double, 3>, 8> local{};  // dN_a / dxi_d
  for (std::size_t a = 0; a < 8; ++a) {
    std::array<double, 3> factor{}, slope{};
    for (std::size_t d = 0; d < 3; ++d) {
      const bool far = (a >> d & 1) != 0;
      factor[d] = far ? xi[d] : 1 - xi[d];
      slope[d] = far ? 1 : -1;
    }
    g.shape[a] = factor[0] * factor[1] * factor[2];
    local[a] = {slope[0] * factor[1] * factor[2], factor[0] * slope[1] * factor[2], factor[0] * factor[1] * slope[2]};
  }
  Matrix3 jacobian{}, inverse{};  // jacobian[i][d] = dx_i / dxi_d
  for (std::size_t a = 0; a < 8; ++a)
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t d = 0; d < 3; ++d) jacobian[i][d] += corners[a][i] * local[a][d];
  g.volume = invert(jacobian, inverse) / 8;
  for (std::size_t a = 0; a < 8; ++a)
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t d = 0; d < 3; ++d) g.gradient[a][i] += local[a][d] * inverse[d][i];
  return g;
}

}  // namespace

HexCorners hex_box(double length_x, double length_y, double length_z) {
  HexCorners corners{};
  for (std::size_t c = 0; c < 8; ++c)
    corners[c] = {(c & 1) != 0 ? length_x : 0, (c >> 1 & 1) != 0 ? length_y : 0, (c >> 2 & 1) != 0 ? length_z : 0};
  return corners;
}

HexStiffness hex8_stiffness(const HexCorners& corners, double young, double poisson) {
  const double lambda = young * poisson / ((1 + poisson) * (1 - 2 * poisson));  // Lame's constants
  const double mu = young / (2 * (1 + poisson));
  HexStiffness stiffness{};
  for (std::size_t point = 0; point < 8; ++point) {
    const GaussPoint g = gauss_point(corners, point);
    for (std::size_t a = 0; a < 8; ++a)
      for (std::size_t b = 0; b <= a; ++b) {
        const auto& p = g.gradient[a];
        const auto& q = g.gradient[b];
        const double dot = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        for (std::size_t i = 0; i < 3; ++i)
          for (std::size_t k = 0; k < 3; ++k)  // lambda p_i q_k + mu p_k q_i + mu delta_ik p.q
            stiffness[(3 * a + i) * 24 + 3 * b + k] +=
                g.volume * (lambda * p[i] * q[k] + mu * p[k] * q[i] + (i == k ? mu * dot : 0));
      }
  }
  for (std::size_t r = 0; r < 24; ++r)
    for (std::size_t c = r + 1; c < 24; ++c) stiffness[r * 24 + c] = stiffness[c * 24 + r];
  return stiffness;
}

HexMass hex8_mass(const HexCorners& corners) {
  HexMass mass{};
  for (std::size_t point = 0; point < 8; ++point) {
    const GaussPoint g = gauss_point(corners, point);
    for (std::size_t a = 0; a < 8; ++a)
      for (std::size_t b = 0; b < 8; ++b) mass[a * 8 + b] += g.volume * (g.shape[a] * g.shape[b]);
  }
  return mass;
}

}  // namespace espalier::matrix
