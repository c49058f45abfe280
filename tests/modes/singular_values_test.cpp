// Singular values of matrices of any shape and rank: the product of the factors, orthogonality, zeros that stay far
// below what is allowed for them.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "dense/dense.hpp"

namespace espalier::singular_values_test {

namespace {

using dense::MatrixXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// m x n of a rank, its columns over eight decades.
MatrixXd matrix(Eigen::Index m, Eigen::Index n, Eigen::Index rank) {
  std::mt19937_64 draw(static_cast<std::uint64_t>(m * 1000 + n * 10 + rank));
  std::uniform_real_distribution<double> number(-1, 1);
  const MatrixXd left = MatrixXd::NullaryExpr(m, rank, [&] { return number(draw); });
  const MatrixXd right = MatrixXd::NullaryExpr(rank, n, [&] { return number(draw); });
  MatrixXd a = dense::times(left, right);
  for (Eigen::Index j = 0; j < n; ++j)
    a.col(j) *= std::pow(10.0, -8.0 * static_cast<double>(j) / static_cast<double>(n));
  return a;
}

void expect_orthonormal(const MatrixXd& q) {
  EXPECT_LT((dense::transposed_times(q, q) - MatrixXd::Identity(q.cols(), q.cols())).norm(),
            1e2 * static_cast<double>(q.rows()) * kEpsilon);
}

TEST(SingularValues, MultiplyToTheMatrix) {
  for (const auto& [m, n, rank] :
       {std::array{1, 1, 1}, {5, 5, 5}, {6, 3, 3}, {3, 7, 3}, {9, 4, 2}, {4, 9, 2}, {6, 6, 0}, {40, 40, 33}}) {
    SCOPED_TRACE(testing::Message() << m << " x " << n << " of rank " << rank);
    const MatrixXd a = matrix(m, n, rank);
    const dense::SingularValues s = dense::singular_values(a);
    const Eigen::Index k = std::min(m, n);
    ASSERT_EQ(s.values.size(), k);
    expect_orthonormal(s.u);
    expect_orthonormal(s.v);
    EXPECT_LE((dense::times(s.u * s.values.asDiagonal(), s.v.leftCols(k).transpose()) - a).norm(),
              1e2 * static_cast<double>(m + n) * kEpsilon * a.norm());
  }
}

TEST(SingularValues, RightVectorsShowTheRank) {
  for (const double unit : {1.0, 1e-200, 1e200})  // whose squares are no numbers
    for (const auto& [m, n, rank] :
         {std::array{5, 5, 5}, {9, 4, 2}, {4, 9, 2}, {6, 6, 0}, {40, 40, 33}, {120, 120, 100}}) {
      SCOPED_TRACE(testing::Message() << m << " x " << n << " of rank " << rank << ", unit " << unit);
      const MatrixXd a = matrix(m, n, rank);
      const dense::RightSingularVectors s = dense::right_singular_vectors(unit * a);
      ASSERT_EQ(s.values.size(), std::min(m, n));
      expect_orthonormal(s.v);
      const MatrixXd av = dense::times(a, s.v);
      for (Eigen::Index k = 0; k < s.values.size(); ++k)
        EXPECT_NEAR(av.col(k).norm(), s.values[k] / unit, 1e2 * kEpsilon * a.norm()) << k;
      EXPECT_EQ((s.values.array() / unit > 2e-13 * a.norm()).count(), rank);
    }
}

// A turn by half a circle has no axis of its own: any across, and the same each time.
TEST(SingularValues, RotationBetweenOppositeDirections) {
  for (const Eigen::Vector3d& from :
       {Eigen::Vector3d(0, 0, 2), Eigen::Vector3d(-1, 2, 3), Eigen::Vector3d(1e-9, 1, 0)}) {
    for (const Eigen::Vector3d& to : {Eigen::Vector3d(-from), Eigen::Vector3d(from), Eigen::Vector3d(3, 1, -2)}) {
      const Eigen::Matrix3d r = dense::rotation_between(from, to);
      EXPECT_LT((r * from.normalized() - to.normalized()).norm(), 8 * kEpsilon);
      EXPECT_LT((r.transpose() * r - Eigen::Matrix3d::Identity()).norm(), 8 * kEpsilon);
    }
  }
}

}  // namespace

}  // namespace espalier::singular_values_test
