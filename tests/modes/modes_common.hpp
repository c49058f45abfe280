/// \file
/// Pencils whose modes are known, and dense references.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"

namespace espalier::test {

inline constexpr double kEps = std::numeric_limits<double>::epsilon();
inline constexpr double kPi = std::numbers::pi;

inline SparseMatrix generated(const std::vector<std::string>& words) {
  return matrix::generate(matrix::parse_generator(words));
}

inline SparseMatrix symmetric(Index n, const std::vector<reference::Triple>& triples) {
  return reference::from_triples(n, triples, Storage::symmetric_lower);
}

inline SparseMatrix diagonal(const std::vector<double>& d) {
  std::vector<reference::Triple> t;
  for (std::size_t i = 0; i < d.size(); ++i)
    if (d[i] != 0) t.push_back({static_cast<Index>(i), static_cast<Index>(i), d[i]});
  return symmetric(static_cast<Index>(d.size()), t);
}

inline SparseMatrix identity(Index n) { return diagonal(std::vector<double>(static_cast<std::size_t>(n), 1.0)); }

/// Masses 1 in a row, springs 1 between them; at both ends a spring to the ground, or none.
inline SparseMatrix string(Index n, bool held = true) {
  std::vector<reference::Triple> t;
  for (Index i = 0; i < n; ++i) {
    t.push_back({i, i, held || (i > 0 && i + 1 < n) ? 2.0 : 1.0});
    if (i + 1 < n) t.push_back({i + 1, i, -1.0});
  }
  return symmetric(n, t);
}

inline Eigen::MatrixXd dense(const SparseMatrix& a) {
  const std::vector<double> v = reference::dense(a);
  return Eigen::Map<const Eigen::MatrixXd>(v.data(), a.rows, a.cols);
}

inline SparseMatrix sparse(const Eigen::MatrixXd& a) {
  std::vector<reference::Triple> t;
  for (Index j = 0; j < a.cols(); ++j)
    for (Index i = j; i < a.rows(); ++i)
      if (a(i, j) != 0) t.push_back({i, j, a(i, j)});
  return symmetric(static_cast<Index>(a.rows()), t);
}

/// Eigenvalues of K x = l M x for a positive definite M, rising (Eigen: Cholesky and tridiagonal QR).
inline std::vector<double> dense_eigenvalues(const Eigen::MatrixXd& k, const Eigen::MatrixXd& m) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> eigen(k, m, Eigen::EigenvaluesOnly);
  return {eigen.eigenvalues().data(), eigen.eigenvalues().data() + eigen.eigenvalues().size()};
}

inline ModesOptions lowest(Index count) {
  ModesOptions o;
  o.count = count;
  o.solver.threads = 2;
  return o;
}

inline ModesOptions all_below(double bound) {
  ModesOptions o;
  o.below = bound;
  o.solver.threads = 2;
  return o;
}

/// Status, proof, eigenvalues against known ones, and what the vectors say: an independent residual and orthogonality.
/// @param accuracy  of eigenvalues, relative to the largest one given
inline void expect_modes(const ModesResult& r, const SparseMatrix& k, const SparseMatrix& m,
                         const std::vector<double>& truth, std::size_t count, double accuracy = 1e-11) {
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_TRUE(r.complete) << r.completeness;
  ASSERT_EQ(r.eigenvalues.size(), count) << r.completeness;
  ASSERT_GE(truth.size(), count);
  ASSERT_EQ(r.vectors.size(), count * static_cast<std::size_t>(k.rows));
  const double size = std::max(std::abs(truth[0]), std::abs(truth[count - 1]));
  for (std::size_t i = 0; i < count; ++i) EXPECT_NEAR(r.eigenvalues[i], truth[i], accuracy * size) << "mode " << i;
  const Eigen::MatrixXd full_k = dense(k), full_m = dense(m);
  const Eigen::Map<const Eigen::MatrixXd> x(r.vectors.data(), k.rows, static_cast<Index>(count));
  const Eigen::MatrixXd mx = full_m * x;
  const double apart = (x.transpose() * mx - Eigen::MatrixXd::Identity(mx.cols(), mx.cols())).cwiseAbs().maxCoeff();
  EXPECT_LE(apart, 1e-9);
  EXPECT_NEAR(r.orthogonality, apart, 1e-12 + 0.1 * apart);
  const double k_norm = full_k.cwiseAbs().rowwise().sum().maxCoeff(),
               m_norm = full_m.cwiseAbs().rowwise().sum().maxCoeff();
  for (Index i = 0; i < static_cast<Index>(count); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double l = r.eigenvalues[at];
    const double residual =
        (full_k * x.col(i) - l * mx.col(i)).norm() / ((k_norm + std::abs(l) * m_norm) * x.col(i).norm());
    EXPECT_LE(residual, 4e-9) << "mode " << i;
    EXPECT_NEAR(r.residuals[at], residual, 1e-14 + 0.1 * residual) << "mode " << i;
  }
}

}  // namespace espalier::test
