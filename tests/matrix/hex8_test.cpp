#include "matrix/generators/hex8.hpp"

#include <limits>
#include <numeric>

#include "matrix/helpers.hpp"

namespace espalier::matrix {
namespace hex8_test {

constexpr double kEps = std::numeric_limits<double>::epsilon();
using Matrix24 = Eigen::Matrix<double, 24, 24>;

HexCorners skewed() {
  HexCorners corners = hex_box(1.0, 1.3, 0.4);
  for (std::size_t c = 0; c < 8; ++c) corners[c][0] += 0.15 * corners[c][1] - 0.2 * corners[c][2] * corners[c][1];
  return corners;
}

Matrix24 stiffness_of(const HexCorners& corners) {
  const HexStiffness k = hex8_stiffness(corners, 1.0, 0.3);
  return Eigen::Map<const Matrix24>(k.data());
}

// Truth: a free body has exactly six modes without strain energy: translations and infinitesimal rotations.
TEST(Hex8, SixRigidBodyModes) {
  for (const auto& corners : {hex_box(1, 1, 1), hex_box(1, 1, 0.3), skewed()}) {
    const Matrix24 k = stiffness_of(corners);
    EXPECT_EQ(k, k.transpose());
    const Eigen::SelfAdjointEigenSolver<Matrix24> eigen(k);
    const double tolerance = 24 * kEps * eigen.eigenvalues()(23);
    for (int i = 0; i < 6; ++i) EXPECT_LE(std::abs(eigen.eigenvalues()(i)), tolerance);
    EXPECT_GT(eigen.eigenvalues()(6), 1e6 * tolerance);
    Eigen::Matrix<double, 24, 6> modes = Eigen::Matrix<double, 24, 6>::Zero();
    for (int a = 0; a < 8; ++a) {
      const auto& x = corners[static_cast<std::size_t>(a)];
      for (int d = 0; d < 3; ++d) {
        modes(3 * a + d, d) = 1;                                                       // translation
        modes(3 * a + d, 3 + (d + 1) % 3) = x[static_cast<std::size_t>((d + 2) % 3)];  // rotation
        modes(3 * a + d, 3 + (d + 2) % 3) = -x[static_cast<std::size_t>((d + 1) % 3)];
      }
    }
    EXPECT_LE((k * modes).cwiseAbs().maxCoeff(), tolerance);
  }
}

// Truth: the patch test. A linear displacement has constant strain; its energy is volume times energy density.
TEST(Hex8, EnergyOfConstantStrain) {
  const double young = 1.0, nu = 0.3;
  const auto corners = hex_box(1.0, 2.0, 0.5);
  const Matrix24 k = stiffness_of(corners);
  Eigen::Matrix<double, 24, 1> u = Eigen::Matrix<double, 24, 1>::Zero();
  for (int a = 0; a < 8; ++a) u(3 * a) = corners[static_cast<std::size_t>(a)][0];  // strain xx = 1
  const double modulus = young * (1 - nu) / ((1 + nu) * (1 - 2 * nu));             // lambda + 2 mu
  EXPECT_NEAR(u.dot(k * u), modulus * 1.0, 100 * kEps);
  for (int a = 0; a < 8; ++a) u(3 * a) = corners[static_cast<std::size_t>(a)][1];  // shear xy = 1
  EXPECT_NEAR(u.dot(k * u), young / (2 * (1 + nu)) * 1.0, 100 * kEps);
}

// Truth: closed form of the consistent mass of a box: V / 216 times 8, 4, 2 or 1 by the number of shared coordinates.
TEST(Hex8, MassOfABox) {
  const HexMass m = hex8_mass(hex_box(2, 3, 5));
  for (std::size_t a = 0; a < 8; ++a)
    for (std::size_t b = 0; b < 8; ++b) {
      const int differing = __builtin_popcount(static_cast<unsigned>(a ^ b));
      EXPECT_NEAR(m[a * 8 + b], 30.0 / 216 * (8 >> differing), 30 * 10 * kEps);
      EXPECT_EQ(m[a * 8 + b], m[b * 8 + a]);
    }
  EXPECT_NEAR(std::accumulate(m.begin(), m.end(), 0.0), 30.0, 30 * 64 * kEps) << "sum = volume times density";
}

}  // namespace hex8_test
}  // namespace espalier::matrix
