// Quadratic eigenvalue problems against the dense method on the linearization, and closed forms.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "espalier/modes.hpp"

namespace espalier {
namespace {

using Complex = std::complex<double>;

SparseMatrix sparse(const Eigen::MatrixXd& a) {
  SparseMatrix out;
  out.rows = static_cast<Index>(a.rows());
  out.cols = static_cast<Index>(a.cols());
  out.col_ptr.push_back(0);
  for (Eigen::Index j = 0; j < a.cols(); ++j) {
    for (Eigen::Index i = 0; i < a.rows(); ++i)
      if (a(i, j) != 0 || i == j) {
        out.row_ind.push_back(static_cast<Index>(i));
        out.values.push_back(a(i, j));
      }
    out.col_ptr.push_back(static_cast<Offset>(out.row_ind.size()));
  }
  return out;
}

// A chain of n masses with springs to its neighbours and to the ground.
Eigen::MatrixXd chain(int n, double ground) {
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < n; ++i) {
    k(i, i) = 2 + ground;
    if (i > 0) k(i, i - 1) = k(i - 1, i) = -1;
  }
  return k;
}

// All finite eigenvalues with imaginary part >= 0, by distance from the shift.
std::vector<Complex> dense(const Eigen::MatrixXd& k, const Eigen::MatrixXd& c, const Eigen::MatrixXd& m, double shift) {
  const Eigen::Index n = k.rows();
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  a.topRightCorner(n, n).setIdentity();
  a.bottomLeftCorner(n, n) = -m.inverse() * k;
  a.bottomRightCorner(n, n) = -m.inverse() * c;
  const Eigen::VectorXcd all = a.eigenvalues();
  std::vector<Complex> out;
  for (const Complex& l : all)
    if (l.imag() >= -1e-12 * std::abs(l)) out.push_back(l);
  std::sort(out.begin(), out.end(), [&](Complex x, Complex y) { return std::abs(x - shift) < std::abs(y - shift); });
  return out;
}

void expect_dense(const Eigen::MatrixXd& k, const Eigen::MatrixXd& c, const Eigen::MatrixXd& m, Index count,
                  double shift = -0.01) {
  QuadraticModesOptions options;
  options.count = count;
  options.shift = shift;
  options.solver.threads = 1;
  const QuadraticModesResult r = find_quadratic_modes(sparse(k), sparse(c), sparse(m), options);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  ASSERT_EQ(r.count(), count);
  const std::vector<Complex> truth = dense(k, c, m, shift);
  for (Index i = 0; i < count; ++i) {
    EXPECT_LT(std::abs(r.eigenvalues[static_cast<std::size_t>(i)] - truth[static_cast<std::size_t>(i)]),
              1e-8 * std::abs(truth[static_cast<std::size_t>(i)]))
        << i << r.eigenvalues[static_cast<std::size_t>(i)] << truth[static_cast<std::size_t>(i)];
    EXPECT_LT(r.residuals[static_cast<std::size_t>(i)], options.tolerance);
  }
}

TEST(QuadraticModes, AreThoseOfTheDenseMethod) {
  const int n = 60;
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> uniform(0.5, 1.5);
  const Eigen::MatrixXd k = chain(n, 0.02);
  Eigen::MatrixXd m = Eigen::MatrixXd::Zero(n, n), c = Eigen::MatrixXd::Zero(n, n), g = c;
  for (int i = 0; i < n; ++i) m(i, i) = uniform(engine);
  for (int i = 0; i < n; i += 7) c(i, i) = uniform(engine);  // some dampers: not modal
  for (int i = 0; i + 1 < n; ++i) {
    g(i, i + 1) = 0.3 * uniform(engine);
    g(i + 1, i) = -g(i, i + 1);
  }
  expect_dense(k, c, m, 10);
  expect_dense(k, g, m, 10);                // gyroscopic: purely imaginary
  expect_dense(k, 30 * c, m, 10);           // overdamped parts: real eigenvalues
  expect_dense(k + 0.1 * g, c + g, m, 10);  // circulatory
  expect_dense(k, c, m, 6, 0.7);
}

// Truth: m x'' + c x' + k x of one mass; and a mass held by a multiplier beside it.
TEST(QuadraticModes, OfOneMassAndAConstraint) {
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(3, 3), c = k, m = k;
  k(0, 0) = 4;
  c(0, 0) = 0.4;
  m(0, 0) = m(1, 1) = 1;
  k(1, 1) = 1;
  k(1, 2) = k(2, 1) = 1;  // x_1 = 0
  QuadraticModesOptions options;
  options.count = 1;
  const QuadraticModesResult r = find_quadratic_modes(sparse(k), sparse(c), sparse(m), options);
  ASSERT_TRUE(r.status.ok()) << r.status.message;
  EXPECT_LT(std::abs(r.eigenvalues[0] - Complex(-0.2, std::sqrt(4 - 0.04))), 1e-12);
  EXPECT_LT(std::abs(r.vectors[1]), 1e-12);
}

TEST(QuadraticModes, SaysWhatCannotBe) {
  const SparseMatrix a = sparse(chain(4, 1)), zero = sparse(Eigen::MatrixXd::Zero(4, 4)), b = sparse(chain(3, 1));
  QuadraticModesOptions options;
  options.count = 2;
  EXPECT_EQ(find_quadratic_modes(a, zero, b, options).status.code, StatusCode::invalid_input);
  EXPECT_EQ(find_quadratic_modes(zero, zero, zero, options).status.code, StatusCode::singular);
  options.count = 0;
  EXPECT_EQ(find_quadratic_modes(a, zero, a, options).status.code, StatusCode::invalid_input);
  options.count = 9;
  EXPECT_EQ(find_quadratic_modes(a, zero, a, options).status.code, StatusCode::invalid_input);
  options.count = 1;
  options.shift = -INFINITY;
  EXPECT_EQ(find_quadratic_modes(a, zero, a, options).status.code, StatusCode::invalid_input);
  SparseMatrix nan = a;
  nan.values[0] = NAN;
  options.shift = 0;
  EXPECT_EQ(find_quadratic_modes(nan, zero, a, options).status.code, StatusCode::invalid_input);
}

}  // namespace
}  // namespace espalier
