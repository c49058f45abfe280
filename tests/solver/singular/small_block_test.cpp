// Dense arithmetic on a few long vectors. Truth: Eigen's decompositions, sums in long double.
#include "solver/deficiency/small_block.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "reference/reference.hpp"

namespace espalier::solver {
namespace small_block_test {

Block random_block(Index rows, Index columns, std::uint64_t seed) {
  Block b(rows, columns);
  b.values = reference::random_vector(std::int64_t{rows} * columns, seed);
  return b;
}

Eigen::Map<const Eigen::MatrixXd> dense(const Block& b) { return {b.values.data(), b.rows, b.columns}; }

TEST(SmallBlock, SumsOfLongVectors) {
  for (const Index n : {1, 100, 5000, 100000}) {
    const Block x = random_block(n, 2, 3);
    long double sum = 0, square = 0;
    for (Index k = 0; k < n; ++k) {
      sum += static_cast<long double>(x.column(0)[k]) * x.column(1)[k];
      square += static_cast<long double>(x.column(0)[k]) * x.column(0)[k];
    }
    double first = 0;
    for (const int threads : {1, 2, 3}) {
      base::ThreadPool pool(threads);
      const double found = dot(pool, x.column(0), x.column(1), n);
      if (threads == 1) first = found;
      EXPECT_EQ(found, first) << "of any number of threads";
      EXPECT_NEAR(found, static_cast<double>(sum), 1e-14 * std::sqrt(n) * 10);
      EXPECT_NEAR(norm_two(pool, x.column(0), n), static_cast<double>(std::sqrt(square)), 1e-13 * std::sqrt(n));
    }
  }
}

// Short blocks are rotated themselves, long ones by their triangle. Columns of very different lengths keep their
// digits.
TEST(SmallBlock, RotatesApartToSingularVectors) {
  base::ThreadPool pool(2);
  for (const Index rows : {6, 12, 400, 20000}) {
    const Index columns = 6;
    Block y = random_block(rows, columns, 5), q(columns, columns);
    const double sizes[] = {1e-3, 1, 1e-9, 30, 1e-6, 1e-12};
    for (Index c = 0; c < columns; ++c) {
      for (Index k = 0; k < rows; ++k) y.column(c)[k] *= sizes[c];
      q.column(c)[c] = 1;
    }
    const Eigen::MatrixXd before = dense(y);
    const std::vector<double> lengths = rotate_apart(pool, y, q);
    EXPECT_TRUE(std::is_sorted(lengths.begin(), lengths.end()));
    const Eigen::MatrixXd v = dense(q), after = dense(y);
    EXPECT_LE((v.transpose() * v - Eigen::MatrixXd::Identity(columns, columns)).norm(), 1e-13);
    EXPECT_LE((before * v - after).norm(), 1e-13 * before.norm());
    for (Index c = 0; c < columns; ++c) {
      EXPECT_NEAR(after.col(c).norm(), lengths[static_cast<std::size_t>(c)],
                  1e-13 * lengths[static_cast<std::size_t>(c)]);
      for (Index d = 0; d < c; ++d)
        EXPECT_LE(std::abs(after.col(c).dot(after.col(d))), 1e-10 * after.col(c).norm() * after.col(d).norm());
    }
    const Eigen::VectorXd values = Eigen::JacobiSVD<Eigen::MatrixXd>(before).singularValues().reverse();
    for (Index c = 0; c < columns; ++c)
      EXPECT_NEAR(lengths[static_cast<std::size_t>(c)], values[c], 1e-10 * values[c] + 1e-17 * values[columns - 1])
          << rows;
  }
}

TEST(SmallBlock, RitzValuesAreThoseOfTheSymmetricPart) {
  base::ThreadPool pool(2);
  for (const Index columns : {1, 2, 7}) {
    const Block x = random_block(300, columns, 7), y = random_block(300, columns, 8);
    const Eigen::MatrixXd s = dense(x).transpose() * dense(y);
    Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(0.5 * (s + s.transpose())).eigenvalues();
    std::sort(values.data(), values.data() + columns, [](double a, double b) { return std::abs(a) < std::abs(b); });
    const std::vector<double> found = ritz_values(pool, x, y);
    ASSERT_EQ(static_cast<Index>(found.size()), columns);
    for (Index c = 0; c < columns; ++c)
      EXPECT_NEAR(found[static_cast<std::size_t>(c)], values[c], 1e-11 * s.norm()) << columns;
  }
}

TEST(SmallBlock, OrthonormalColumnsSpanTheSame) {
  base::ThreadPool pool(2);
  Block x = random_block(500, 5, 9), again = random_block(500, 3, 10);
  for (Index k = 0; k < 500; ++k) x.column(3)[k] = x.column(0)[k] - 2 * x.column(1)[k];  // depends on the others
  const Eigen::MatrixXd before = dense(x);
  orthonormalize(pool, x);
  const Eigen::MatrixXd q = dense(x);
  EXPECT_LE((q.transpose() * q - Eigen::MatrixXd::Identity(5, 5)).norm(), 1e-13);
  EXPECT_LE((before - q * (q.transpose() * before)).norm(), 1e-13 * before.norm());
  project_out(pool, x, again);
  EXPECT_LE((q.transpose() * dense(again)).norm(), 1e-13 * dense(again).norm());
}

}  // namespace small_block_test
}  // namespace espalier::solver
