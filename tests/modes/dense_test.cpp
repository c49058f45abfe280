// Modes against dense eigenvalues: solids, free bodies, unknowns without mass, constraints, masses that are singular.
#include <algorithm>

#include "matrix/read.hpp"
#include "modes/modes_common.hpp"
#include "places.hpp"

namespace espalier {

using namespace test;

namespace {

// The finite eigenvalues of K x = l M x where the last `constraints` rows are those of multipliers: on the null space
// of their block, which a full pivoted QR factorization gives.
std::vector<double> eliminated(const Eigen::MatrixXd& k, const Eigen::MatrixXd& m, Index constraints) {
  const Index n = static_cast<Index>(k.rows()) - constraints;
  const Eigen::MatrixXd g = k.bottomLeftCorner(constraints, n);
  const Eigen::FullPivHouseholderQR<Eigen::MatrixXd> qr(g.transpose());
  const Eigen::MatrixXd q = qr.matrixQ();
  const Eigen::MatrixXd z = q.rightCols(n - qr.rank());
  return dense_eigenvalues(z.transpose() * k.topLeftCorner(n, n) * z, z.transpose() * m.topLeftCorner(n, n) * z);
}

// Unknowns without mass, the last ones, are condensed statically.
std::vector<double> condensed(const Eigen::MatrixXd& k, const Eigen::MatrixXd& m, Index massless) {
  const Index n = static_cast<Index>(k.rows()) - massless;
  const Eigen::MatrixXd k22 = k.bottomRightCorner(massless, massless), k21 = k.bottomLeftCorner(massless, n);
  const Eigen::MatrixXd schur = k.topLeftCorner(n, n) - k21.transpose() * k22.fullPivLu().solve(k21);
  return dense_eigenvalues((schur + schur.transpose()) / 2, m.topLeftCorner(n, n));
}

Eigen::MatrixXd random_matrix(Index rows, Index cols, std::uint64_t seed) {
  const std::vector<double> v = reference::random_vector(static_cast<std::int64_t>(rows) * cols, seed);
  return Eigen::Map<const Eigen::MatrixXd>(v.data(), rows, cols);
}

}  // namespace

TEST(ModesDense, AClampedSolidWithItsConsistentMass) {
  const SparseMatrix k = generated({"elasticity", "6", "5", "4"}), m = generated({"elasticity-mass", "6", "5", "4"});
  const std::vector<double> truth = dense_eigenvalues(dense(k), dense(m));
  for (const Index count : {1, 20, 100, 540})
    expect_modes(find_modes(k, m, lowest(count)), k, m, truth, static_cast<std::size_t>(count));
}

TEST(ModesDense, StorageDoesNotMatter) {
  const SparseMatrix k = generated({"elasticity", "3"}), m = generated({"elasticity-mass", "3"});
  const std::vector<double> truth = dense_eigenvalues(dense(k), dense(m));
  for (const Storage storage : {Storage::general, Storage::symmetric_both, Storage::symmetric_upper})
    for (const bool split : {false, true}) {
      const SparseMatrix k2 = reference::stored_as(k, storage, split), m2 = reference::stored_as(m, storage, split);
      expect_modes(find_modes(k2, m2, lowest(9)), k, m, truth, 9);
    }
}

TEST(ModesDense, NegativeEigenvaluesComeFirst) {
  const Index n = 120;
  Eigen::MatrixXd a = dense(reference::random_system(n, 6, reference::Values::indefinite, 3));
  const SparseMatrix k = sparse(a), m = identity(n);
  const std::vector<double> truth = dense_eigenvalues(a, Eigen::MatrixXd::Identity(n, n));
  ASSERT_LT(truth[20], 0);
  for (const Index count : {1, 7, 30, 110})
    expect_modes(find_modes(k, m, lowest(count)), k, m, truth, static_cast<std::size_t>(count));
  const double bound = (truth[14] + truth[15]) / 2;
  expect_modes(find_modes(k, m, all_below(bound)), k, m, truth, 15);
}

TEST(ModesDense, UnknownsWithoutMass) {
  const Index n = 150, massless = 60;
  Eigen::MatrixXd k = dense(reference::random_system(n, 5, reference::Values::positive, 11));
  std::vector<double> d(static_cast<std::size_t>(n), 0.0);
  for (Index i = 0; i < n - massless; ++i) d[static_cast<std::size_t>(i)] = 1 + 0.01 * i;
  const SparseMatrix m = diagonal(d);
  for (const double sign : {1.0, -1.0}) {  // of the stiffness of those without mass: infinite eigenvalues of both signs
    if (sign < 0) k.bottomRightCorner(massless, massless) *= -1;
    const SparseMatrix a = sparse(k);
    const ModesResult r = find_modes(a, m, lowest(12));
    expect_modes(r, a, m, condensed(k, dense(m), massless), 12);
    EXPECT_EQ(r.massless, massless);
    EXPECT_EQ(r.finite, n - massless);
  }
}

TEST(ModesDense, ConstraintsByMultipliersAreConstraints) {
  const Index n = 140, constraints = 25;
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(n + constraints, n + constraints);
  k.topLeftCorner(n, n) = dense(reference::random_system(n, 4, reference::Values::positive, 5));
  for (Index c = 0; c < constraints; ++c)
    for (Index j = 0; j < 4; ++j) k(n + c, (c * 5 + j * 7) % n) = 1 + 0.1 * j + 0.01 * c;
  k.topRightCorner(n, constraints) = k.bottomLeftCorner(constraints, n).transpose();
  std::vector<double> d(static_cast<std::size_t>(n + constraints), 0.0);
  for (Index i = 0; i < n; ++i) d[static_cast<std::size_t>(i)] = 1 + 0.02 * i;
  const SparseMatrix a = sparse(k), m = diagonal(d);
  const std::vector<double> truth = eliminated(k, dense(m), constraints);
  for (const Index count : {1, 15, n - constraints})
    expect_modes(find_modes(a, m, lowest(count)), a, m, truth, static_cast<std::size_t>(count), 1e-10);
  const ModesResult r = find_modes(a, m, lowest(15));
  EXPECT_EQ(r.finite, n - constraints);
  for (Index i = 0; i < 15; ++i) {  // the shapes satisfy them
    const Eigen::Map<const Eigen::VectorXd> x(r.vectors.data() + static_cast<std::ptrdiff_t>(n + constraints) * i, n);
    EXPECT_LE((k.bottomLeftCorner(constraints, n) * x).norm(), 1e-10 * x.norm());
  }
}

TEST(ModesDense, AChainOfBodiesWithJoints) {
  // The generator's K + M/2 with multipliers; mass 1 at each node.
  const SparseMatrix k = generated({"kkt", "3", "3", "2", "2"});
  std::vector<double> d(static_cast<std::size_t>(k.rows), 1.0);
  const Eigen::MatrixXd full = dense(k);
  std::vector<Index> multipliers;
  for (Index i = 0; i < k.rows; ++i)
    if (full(i, i) == 0) multipliers.push_back(i), d[static_cast<std::size_t>(i)] = 0;
  ASSERT_EQ(multipliers.size(), 9U);
  Eigen::PermutationMatrix<Eigen::Dynamic> last(k.rows);
  std::vector<Index> order;
  for (Index i = 0; i < k.rows; ++i)
    if (full(i, i) != 0) order.push_back(i);
  order.insert(order.end(), multipliers.begin(), multipliers.end());
  for (Index i = 0; i < k.rows; ++i) last.indices()[i] = order[static_cast<std::size_t>(i)];
  const SparseMatrix m = diagonal(d);
  const std::vector<double> truth = eliminated(last.transpose() * full * last, last.transpose() * dense(m) * last, 9);
  expect_modes(find_modes(k, m, lowest(25)), k, m, truth, 25);
}

TEST(ModesDense, AMassThatIsSingularWithoutZeroRows) {
  // M = B B^T of rank 40 on 60 unknowns: 20 infinite eigenvalues.
  const Index n = 60, rank = 40;
  const Eigen::MatrixXd b = random_matrix(n, rank, 8);
  const Eigen::MatrixXd k = dense(reference::random_system(n, 5, reference::Values::positive, 4));
  const Eigen::MatrixXd mass = b * b.transpose();
  // l of K x = l M x are the reciprocals of the nonzero eigenvalues of L^-1 M L^-T.
  const std::vector<double> reciprocal = dense_eigenvalues(mass, k);
  std::vector<double> truth;
  for (Index i = 0; i < rank; ++i) truth.push_back(1 / reciprocal[static_cast<std::size_t>(n - 1 - i)]);
  const SparseMatrix a = sparse(k), m = sparse((mass + mass.transpose()) / 2);
  const ModesResult r = find_modes(a, m, lowest(10));
  expect_modes(r, a, m, truth, 10);
  EXPECT_EQ(r.finite, rank);
}

TEST(ModesDense, FreeBodiesOfOthersHaveSixRigidMotions) {
  const std::filesystem::path data = shared_data() / "spd";
  for (const char* name : {"exudyn_blockC3D8", "exudyn_blockC3D20R"}) {
    const std::string stiffness = data / (std::string(name) + "_STIF1.mtx"),
                      mass = data / (std::string(name) + "_MASS1.mtx");
    if (!std::filesystem::exists(stiffness)) GTEST_SKIP() << stiffness << " is not here";
    const SparseMatrix k = matrix::read_matrix(stiffness, {}), m = matrix::read_matrix(mass, {});
    const std::vector<double> truth = dense_eigenvalues(dense(k), dense(m));
    const ModesResult r = find_modes(k, m, lowest(40));
    ASSERT_LT(std::abs(truth[5]), 1e-6 * truth[6]);
    ASSERT_GT(truth[6], 1e3);
    expect_modes(r, k, m, truth, 40, 1e-9);
    EXPECT_LE(std::abs(r.eigenvalues[5]), 1e-6 * r.eigenvalues[6]);
    EXPECT_NEAR(r.eigenvalues[6] / truth[6], 1, 1e-9);
  }
}

}  // namespace espalier
