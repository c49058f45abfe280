// Load factors: Euler's column, dense references, constraints.
#include <algorithm>

#include "modes/modes_common.hpp"

namespace espalier {

using namespace test;

namespace {

// A column of Hermite beam elements, E I = 1, under the unit load of compression: K and Kg of (K - l Kg) x = 0.
// Unknowns: deflection and slope of each node. (J. Przemieniecki, "Theory of Matrix Structural Analysis", sections 5.6
// and 15.2.)
struct Column {
  SparseMatrix k, kg;
};
Column column(Index elements, double length, bool pinned) {
  const double h = length / elements;
  const double stiffness[4][4] = {{12, 6 * h, -12, 6 * h},
                                  {6 * h, 4 * h * h, -6 * h, 2 * h * h},
                                  {-12, -6 * h, 12, -6 * h},
                                  {6 * h, 2 * h * h, -6 * h, 4 * h * h}};
  const double geometric[4][4] = {{36, 3 * h, -36, 3 * h},
                                  {3 * h, 4 * h * h, -3 * h, -h * h},
                                  {-36, -3 * h, 36, -3 * h},
                                  {3 * h, -h * h, -3 * h, 4 * h * h}};
  const Index n = 2 * (elements + 1);
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(n, n), kg = k;
  for (Index e = 0; e < elements; ++e)
    for (Index i = 0; i < 4; ++i)
      for (Index j = 0; j < 4; ++j) {
        k(2 * e + i, 2 * e + j) += stiffness[i][j] / (h * h * h);
        kg(2 * e + i, 2 * e + j) += geometric[i][j] / (30 * h);
      }
  std::vector<Index> free;
  for (Index i = 0; i < n; ++i)
    if (pinned ? i != 0 && i != n - 2 : i > 1) free.push_back(i);
  return {sparse(k(free, free)), sparse(kg(free, free))};
}

}  // namespace

TEST(Buckling, EulersColumns) {
  const double length = 2;
  const Column pinned = column(60, length, true), cantilever = column(60, length, false);
  const ModesResult a = find_buckling_modes(pinned.k, pinned.kg, lowest(5));
  ASSERT_TRUE(a.status.ok()) << a.status.message;
  EXPECT_TRUE(a.complete) << a.completeness;
  for (int j = 1; j <= 5; ++j)  // (j pi / L)^2; the elements' error is of fourth order
    EXPECT_NEAR(a.eigenvalues[static_cast<std::size_t>(j - 1)] / std::pow(j * kPi / length, 2), 1, 2e-5);
  EXPECT_NEAR(a.eigenvalues[0] / std::pow(kPi / length, 2), 1, 1e-7);
  const ModesResult b = find_buckling_modes(cantilever.k, cantilever.kg, lowest(1));
  ASSERT_TRUE(b.status.ok()) << b.status.message;
  EXPECT_NEAR(b.eigenvalues[0] / std::pow(kPi / (2 * length), 2), 1, 1e-7);
  EXPECT_LE(a.orthogonality, 1e-10);
  for (const double r : a.residuals) EXPECT_LE(r, 1e-12);
}

TEST(Buckling, LoadsOfBothSigns) {
  // Kg is indefinite: the positive ones are found, and their number is proven.
  const Index n = 90;
  const Eigen::MatrixXd k = dense(reference::random_system(n, 5, reference::Values::positive, 4));
  const Eigen::MatrixXd kg = dense(reference::random_system(n, 5, reference::Values::indefinite, 9));
  const std::vector<double> reciprocal = dense_eigenvalues(kg, k);
  const ModesResult r = find_buckling_modes(sparse(k), sparse(kg), lowest(12));
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_TRUE(r.complete) << r.completeness;
  for (std::size_t i = 0; i < 12; ++i)
    EXPECT_NEAR(r.eigenvalues[i] * reciprocal[static_cast<std::size_t>(n) - 1 - i], 1, 1e-11) << i;
  const Eigen::Map<const Eigen::MatrixXd> x(r.vectors.data(), n, 12);
  EXPECT_LE((x.transpose() * k * x - Eigen::MatrixXd::Identity(12, 12)).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(Buckling, AHingeByMultipliersIsASupport) {
  // The pinned column as a free one whose ends are held by multipliers.
  const Column pinned = column(20, 1, true), cantilever = column(20, 1, false);
  const Index n = cantilever.k.rows;
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(n + 1, n + 1), kg = k;
  k.topLeftCorner(n, n) = dense(cantilever.k);
  kg.topLeftCorner(n, n) = dense(cantilever.kg);
  k(n, n - 2) = k(n - 2, n) = 1;  // the deflection of the free end
  const ModesResult r = find_buckling_modes(sparse(k), sparse(kg), lowest(3));
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_TRUE(r.complete) << r.completeness;
  EXPECT_NEAR(r.eigenvalues[0], std::pow(4.493409457909064, 2), 2e-4);  // tan x = x: clamped, and held at the end
  // Truth: the row and the column of that deflection left out.
  std::vector<Index> free;
  for (Index i = 0; i < n; ++i)
    if (i != n - 2) free.push_back(i);
  const std::vector<double> reciprocal =
      dense_eigenvalues(dense(cantilever.kg)(free, free), dense(cantilever.k)(free, free));
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(r.eigenvalues[i] * reciprocal[reciprocal.size() - 1 - i], 1, 1e-10);
}

TEST(Buckling, RefusesWhatCannotBuckle) {
  const SparseMatrix kg = string(6);
  ModesResult r = find_buckling_modes(string(6, false), kg, lowest(1));
  EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::singular)) << r.status.message;
  EXPECT_NE(r.status.message.find("K is singular"), std::string::npos);
  r = find_buckling_modes(diagonal({1, -1, 1}), identity(3), lowest(1));
  EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::invalid_input));
  EXPECT_NE(r.status.message.find("not positive definite"), std::string::npos) << r.status.message;
  r = find_buckling_modes(string(6), diagonal({1, -1, 2, 0, 0, -3}), lowest(3));
  EXPECT_EQ(static_cast<int>(r.status.code), static_cast<int>(StatusCode::invalid_input)) << r.status.message;
  EXPECT_NE(r.status.message.find("Kg has 2 positive"), std::string::npos) << r.status.message;
  EXPECT_EQ(find_buckling_modes(string(6), diagonal({1, -1, 2, 0, 0, -3}), lowest(2)).count(), 2);
  EXPECT_NE(find_buckling_modes(string(6), kg, ModesOptions{}).status.message.find("nothing is asked"),
            std::string::npos);
}

}  // namespace espalier
