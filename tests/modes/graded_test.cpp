// Pencils of blocks whose stiffness lies decades apart, with many equal eigenvalues: next to these K - s M of the small
// blocks is rounding of the large ones, and singular. Truth: the closed forms of the blocks.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "modes/modes_common.hpp"

namespace espalier {

using namespace test;

namespace {

using Eigen::MatrixXd;

struct Block {
  MatrixXd k, m;
  std::vector<double> eigenvalues;  // the finite ones
  Index copies = 1;
};

struct Graded {
  SparseMatrix k, m;
  std::vector<double> eigenvalues;
};

/// @param stride  rows i, i + stride, ... follow each other; without a divisor in common with n
Graded pencil_of(const std::vector<Block>& blocks, double mass = 1, Index stride = 1) {
  Index n = 0;
  for (const Block& b : blocks) n += b.copies * static_cast<Index>(b.k.rows());
  MatrixXd k = MatrixXd::Zero(n, n), m = MatrixXd::Zero(n, n);
  Graded out;
  Index at = 0;
  for (const Block& b : blocks)
    for (Index copy = 0; copy < b.copies; ++copy, at += static_cast<Index>(b.k.rows())) {
      k.block(at, at, b.k.rows(), b.k.cols()) = b.k;
      m.block(at, at, b.k.rows(), b.k.cols()) = mass * b.m;
      for (const double l : b.eigenvalues) out.eigenvalues.push_back(l / mass);
    }
  std::sort(out.eigenvalues.begin(), out.eigenvalues.end());
  std::vector<Index> order;
  for (Index i = 0; i < n; ++i) order.push_back(i * stride % n);
  out.k = sparse(k(order, order));
  out.m = sparse(m(order, order));
  return out;
}

Block pair(double stiffness) {
  MatrixXd k(2, 2);
  k << 1, -1, -1, 1;
  return {stiffness * k, MatrixXd::Identity(2, 2), {0, 2 * stiffness}};
}

Block massless(double stiffness) {
  MatrixXd k(2, 2);
  k << 2, -1, -1, 1;
  return {stiffness * k, Eigen::Vector2d(1, 0).asDiagonal(), {stiffness}};
}

Block constraint(double stiffness) {
  MatrixXd k(2, 2);
  k << 0, 1, 1, 0;
  return {stiffness * k, Eigen::Vector2d(1, 0).asDiagonal(), {}};
}

Block free_string(Index n, double stiffness) {
  std::vector<double> eigenvalues;
  for (Index i = 0; i < n; ++i) eigenvalues.push_back(stiffness * (2 - 2 * std::cos(kPi * i / n)));
  return {stiffness * dense(string(n, false)), MatrixXd::Identity(n, n), eigenvalues};
}

/// x x^T
Block rank_one(const Eigen::VectorXd& x, double stiffness) {
  const Eigen::Index n = x.size();
  std::vector<double> eigenvalues(static_cast<std::size_t>(n) - 1, 0.0);
  eigenvalues.push_back(stiffness * x.squaredNorm());
  return {stiffness * x * x.transpose(), MatrixXd::Identity(n, n), eigenvalues};
}

double worst_error(const ModesResult& r, const Graded& p) {
  double worst = 0;
  const double size = std::max(std::abs(p.eigenvalues.front()), std::abs(p.eigenvalues.back()));
  for (std::size_t i = 0; i < r.eigenvalues.size(); ++i)
    worst = std::max(worst, std::abs(r.eigenvalues[i] - p.eigenvalues[i]) / size);
  return worst;
}

void expect_found(const Graded& p, Index count) {
  const ModesResult r = find_modes(p.k, p.m, lowest(count));
  EXPECT_TRUE(r.status.ok()) << r.status.message;
  ASSERT_EQ(r.count(), count);
  EXPECT_LE(worst_error(r, p), 1e-11);
}

// Next to the last one that is wanted, a zero among many, nothing can be counted: one far below is sought all the same.
TEST(ModesGraded, OneFarBelowManyZeros) {
  MatrixXd k(2, 2);
  k << -4, -3, -3, 6;
  const double root = std::sqrt(34.0);
  Block zeros = rank_one(Eigen::Vector4d(0, 2, 2, 1), 0x1p-30);
  zeros.copies = 4;
  expect_found(pencil_of({zeros, {k, 6 * MatrixXd::Identity(2, 2), {(1 - root) / 6, (1 + root) / 6}}, pair(0x1p-10)}),
               13);
}

// Nor here: the zeros are sought to their end.
TEST(ModesGraded, OneOfManyZeros) {
  MatrixXd large(6, 6), small(3, 3);
  large << 17, 0, -7, -8, 0, 7,  //
      0, 6, 0, 2, -2, 2,         //
      -7, 0, 17, 8, -4, -1,      //
      -8, 2, 8, 11, 4, -1,       //
      0, -2, -4, 4, 11, 2,       //
      7, 2, -1, -1, 2, 6;
  small << 8, 0, -2, 0, 8, 6, -2, 6, 5;
  const auto block = [](const MatrixXd& k, Index copies) {
    const MatrixXd m = MatrixXd::Identity(k.rows(), k.cols());
    return Block{k, m, dense_eigenvalues(k, m), copies};
  };
  expect_found(pencil_of({block(rank_one(Eigen::Vector3d::Ones(), 0x1p-10).k, 3), block(0x1p30 * large, 3),
                          block(0x1p-10 * small, 2), block(pair(0x1p-30).k, 3)},
                         0x1p100),
               1);
}

// Two zeros that rounding keeps apart: no number between them can be counted, and the gap behind both is as good.
TEST(ModesGraded, AGapThatIsRounding) {
  expect_found(pencil_of({free_string(11, 0x1p-30), constraint(1), massless(0x1p30), free_string(8, 1)}, 128), 1);
}

// 32 equal ones at either side of zero and as many zeros: a number on those above zero counts some of them, which is
// no proof that those below zero are found. What is not found is said.
TEST(ModesGraded, WhatIsMissingBelowIsSaid) {
  MatrixXd k(3, 3);
  k << 0, 4, 0, 4, 0, 2, 0, 2, 0;
  const double root = std::sqrt(20.0) * 0x1p-70;
  const std::vector<Block> blocks = {{0x1p-70 * k, MatrixXd::Identity(3, 3), {-root, 0, root}, 32},
                                     {massless(0x1p-100).k, massless(1).m, {0x1p-100}, 17},
                                     {constraint(0x1p-110).k, constraint(1).m, {}, 21}};
  int right = 0;
  for (const Index stride : {1, 3, 9, 15, 19, 31, 39, 45}) {
    const Graded p = pencil_of(blocks, 128, stride);
    const ModesResult r = find_modes(p.k, p.m, lowest(69));
    if (!r.status.ok()) continue;
    ++right;
    EXPECT_LE(worst_error(r, p), 1e-11) << "stride " << stride << ": " << r.completeness;
  }
  EXPECT_GE(right, 2);
}

// The same blocks in other units: from all zeros further directions are rounding, and their rows without mass grew
// until they were none. With eigenvalues near 1e-61 OP twice was beyond all numbers.
TEST(ModesGraded, NumbersStayFinite) {
  MatrixXd k(3, 3);
  k << 0, 4, 0, 4, 0, 2, 0, 2, 0;
  const double root = std::sqrt(20.0) * 0x1p30;
  const std::vector<Block> blocks = {{0x1p30 * k, MatrixXd::Identity(3, 3), {-root, 0, root}, 32},
                                     {massless(1).k, massless(1).m, {1}, 17},
                                     {constraint(0x1p-10).k, constraint(1).m, {}, 21}};
  for (const Index stride : {5, 23, 25, 29, 39, 47, 51, 53}) expect_found(pencil_of(blocks, 128, stride), 40);
  MatrixXd tiny(4, 4), m(4, 4);
  tiny << -4, 1, 2, -3, 1, -2, -2, 4, 2, -2, 6, -1, -3, 4, -1, 6;
  m << 10, -5, 2, 4, -5, 6, 2, -6, 2, 2, 14, 0, 4, -6, 0, 14;
  std::vector<double> eigenvalues = dense_eigenvalues(0x1p-10 * tiny, m);
  for (double& l : eigenvalues) l *= 0x1p-100;
  expect_found(pencil_of({{0x1p-110 * tiny, m, eigenvalues}, pair(0x1p-100)}, 0x1p100), 3);
}

}  // namespace
}  // namespace espalier
