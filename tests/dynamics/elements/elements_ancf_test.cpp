// ANCF cable, beam and shell: finite differences, frame indifference, rigid modes, mass.

#include "dynamics/elements/ancf_beam.hpp"
#include "dynamics/elements/ancf_cable.hpp"
#include "dynamics/elements/ancf_shell.hpp"
#include "dynamics/elements/elements_common.hpp"

namespace espalier::dynamics::test {
namespace elements_ancf_test {

struct Ancf {
  std::string name;
  Evaluate evaluate;
  Vector reference;  // stress-free
  int per_node;      // vertices per node
  double stiffness;  // scale of forces, for tolerances
  int zero_modes;    // energy-free modes
};
std::ostream& operator<<(std::ostream& out, const Ancf& c) { return out << c.name; }

const Material kMaterial{SolidLaw::st_venant_kirchhoff, 200, 0.3, 7};

Vector line_reference(int per_node, double length) {
  Vector x = Vector::Zero(6 * per_node);
  for (int node = 0; node < 2; ++node)
    for (int k = 0; k < per_node; ++k)
      x.segment<3>(3 * (per_node * node + k)) =
          k == 0 ? Eigen::Vector3d(node * length, 0, 0) : Eigen::Vector3d(Eigen::Matrix3d::Identity().col(k - 1));
  return x;
}

/// A beam whose stress-free state is bent and twisted.
Vector curved_reference() {
  Vector x = line_reference(4, 1.3);
  const Eigen::Matrix3d turn = rotation(0.3, 0.2, -0.4);
  for (int k = 1; k < 4; ++k) x.segment<3>(3 * (4 + k)) = turn * x.segment<3>(3 * (4 + k));
  x.segment<3>(12) += Eigen::Vector3d(0, 0.1, -0.05);
  return x;
}

Vector shell_reference() {
  Vector x(24);
  const double corner[4][3] = {{0, 0, 0}, {1.2, 0.1, 0.05}, {1.1, 0.9, 0.1}, {-0.1, 1.0, 0}};
  for (int a = 0; a < 4; ++a) {
    x.segment<3>(6 * a) = Eigen::Vector3d(corner[a][0], corner[a][1], corner[a][2]);
    x.segment<3>(6 * a + 3) = rotation(0.05 * a + 0.01, -0.1, 0.02) * Eigen::Vector3d::UnitZ();
  }
  return x;
}

std::vector<Ancf> cases() {
  const CableSection cable{150, 3, 2};
  BeamSection beam = rectangular_section(kMaterial, 0.4, 0.2);
  const BeamSection same = beam;
  // A straight cable bent in its Hermite space: 12 coordinates, 3 + 2 rigid modes (torsion is no motion of it).
  return {{"cable", [=](const ElementInput& in, ElementOutput& out) { return evaluate_cable(cable, 1.3, in, out); },
           line_reference(2, 1.3), 2, 150, 5},
          {"beam", [=](const ElementInput& in, ElementOutput& out) { return evaluate_beam(same, 1.3, in, out); },
           line_reference(4, 1.3), 4, 20, 6},
          {"curvedbeam", [=](const ElementInput& in, ElementOutput& out) { return evaluate_beam(same, 1.3, in, out); },
           curved_reference(), 4, 20, 6},
          {"shell", [](const ElementInput& in, ElementOutput& out) { return evaluate_shell(kMaterial, 0.1, in, out); },
           shell_reference(), 2, 20, 6}};
}

class AncfElement : public testing::TestWithParam<Ancf> {};

TEST_P(AncfElement, TangentMatchesFiniteDifferences) {
  const Ancf& c = GetParam();
  const Vector x = rotated(rotation(0.4, 0.2, -0.9), c.reference) + noise(c.reference.size(), 0.03, 11);
  expect_exact_tangent(c.evaluate, c.reference, x, Vector(), 0, 1);
}

TEST_P(AncfElement, DampedTangentMatchesFiniteDifferences) {
  const Ancf& c = GetParam();
  const Vector x = rotated(rotation(0.4, 0.2, -0.9), c.reference) + noise(c.reference.size(), 0.03, 11);
  expect_exact_tangent(c.evaluate, c.reference, x, noise(x.size(), 1.5, 13), 0.2, 1);
}

// Truth: gradients turn with the body and do not translate, positions do both.
TEST_P(AncfElement, FrameIndifference) {
  const Ancf& c = GetParam();
  expect_frame_indifference(c.evaluate, c.reference, c.reference + noise(c.reference.size(), 0.03, 3), c.stiffness,
                            false);
  Vector moved = c.reference;
  for (Eigen::Index a = 0; a < moved.size() / 3; a += c.per_node) moved.segment<3>(3 * a) += Eigen::Vector3d(3, -2, 5);
  EXPECT_LT(run(c.evaluate, c.reference, moved, Vector(), 0, 1, 0).force.cwiseAbs().maxCoeff(),
            1e4 * kEps * c.stiffness);
}

TEST_P(AncfElement, RigidSpinIsNotDamped) {
  const Ancf& c = GetParam();
  const Vector x = rotated(rotation(1, 2, 3), c.reference);
  Vector v(x.size());
  for (Eigen::Index a = 0; a < x.size() / 3; ++a)
    v.segment<3>(3 * a) = Eigen::Vector3d(3, -1, 2).cross(x.segment<3>(3 * a));
  EXPECT_LT(run(c.evaluate, c.reference, x, v, 0.5, 1, 0).force.cwiseAbs().maxCoeff(), 1e4 * kEps * c.stiffness);
}

TEST_P(AncfElement, RigidModesOnly) {
  const Ancf& c = GetParam();
  const Result r = run(c.evaluate, c.reference, c.reference, Vector(), 0, 1, 0);
  const Vector eigenvalues = Eigen::SelfAdjointEigenSolver<Matrix>(r.tangent).eigenvalues();
  const double threshold = 1e-11 * eigenvalues.maxCoeff();
  EXPECT_EQ((eigenvalues.array() < threshold).count(), c.zero_modes) << eigenvalues.transpose();
  EXPECT_GT(eigenvalues.minCoeff(), -threshold);
}

INSTANTIATE_TEST_SUITE_P(All, AncfElement, testing::ValuesIn(cases()), [](const auto& p) { return p.param.name; });

// Truth: mass, first and second moments of a straight prism about its end, exact.
TEST(AncfMass, PrismMoments) {
  const double l = 1.3, h = 0.4, w = 0.2, rho = 7;
  const double total = rho * l * h * w;
  Matrix m(8, 8);
  beam_mass(rectangular_section(kMaterial, h, w), l, m.data());
  const Vector x = line_reference(4, l);
  const Vector ones = (Vector(8) << 1, 0, 0, 0, 1, 0, 0, 0).finished();
  EXPECT_NEAR(ones.dot(m * ones), total, 100 * kEps);
  const Eigen::Map<const Eigen::Matrix<double, 3, 8>> points(x.data());
  const Eigen::Matrix3d second = points * m * points.transpose();  // integral of rho r r^T with y, z from r_y, r_z
  EXPECT_NEAR(second(0, 0), total * l * l / 3, 100 * kEps);
  EXPECT_NEAR(second(1, 1), total * h * h / 12, 100 * kEps);
  EXPECT_NEAR(second(2, 2), total * w * w / 12, 100 * kEps);
  Matrix cable(4, 4);
  cable_mass({1, 1, 2.5}, l, cable.data());
  const Vector ends = (Vector(4) << 1, 0, 1, 0).finished(), axis = (Vector(4) << 0, 1, l, 1).finished();
  EXPECT_NEAR(ends.dot(cable * ends), 2.5 * l, 100 * kEps);
  EXPECT_NEAR(axis.dot(cable * axis), 2.5 * l * l * l / 3, 100 * kEps);
}

TEST(AncfMass, PlateMoments) {
  const double a = 1.5, b = 0.7, h = 0.2, rho = 7, total = rho * a * b * h;
  Vector x = Vector::Zero(24);
  const double corner[4][2] = {{0, 0}, {a, 0}, {a, b}, {0, b}};
  for (int k = 0; k < 4; ++k) {
    x[6 * k] = corner[k][0];
    x[6 * k + 1] = corner[k][1];
    x[6 * k + 5] = 1;
  }
  Matrix m(8, 8);
  shell_mass(rho, h, x.data(), m.data());
  EXPECT_LT((m - m.transpose()).cwiseAbs().maxCoeff(), 100 * kEps);
  const Eigen::Map<const Eigen::Matrix<double, 3, 8>> points(x.data());
  const Eigen::Matrix3d second = points * m * points.transpose();
  EXPECT_NEAR(second(0, 0), total * a * a / 3, 100 * kEps);
  EXPECT_NEAR(second(1, 1), total * b * b / 3, 100 * kEps);
  EXPECT_NEAR(second(2, 2), total * h * h / 12, 100 * kEps);
}

}  // namespace elements_ancf_test
}  // namespace espalier::dynamics::test
