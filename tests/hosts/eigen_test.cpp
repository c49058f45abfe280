// espalier/eigen.hpp in Eigen's own programs. Truths: Eigen's SparseLU and dense solvers, the inertia of a saddle
// point.
#include "espalier/eigen.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/SparseLU>
#include <cmath>
#include <type_traits>

namespace espalier::test {
namespace {

template <class Matrix>
Matrix matrix(int n, bool symmetric, double sign = 1) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int k = 0; k < n; ++k) {
    entries.emplace_back(k, k, sign * (4 + k % 3));
    if (k + 4 < n) entries.emplace_back(k + 4, k, -1);
    if (k + 4 < n) entries.emplace_back(k, k + 4, symmetric ? -1 : 0.5);
  }
  Matrix a(n, n);
  a.setFromTriplets(entries.begin(), entries.end());
  return a;
}

using Kinds = ::testing::Types<Eigen::SparseMatrix<double>, Eigen::SparseMatrix<double, Eigen::RowMajor>,
                               Eigen::SparseMatrix<double, Eigen::ColMajor, std::int64_t>,
                               Eigen::SparseMatrix<double, Eigen::RowMajor, long long>>;
template <class Matrix>
class EigenHeader : public ::testing::Test {};
TYPED_TEST_SUITE(EigenHeader, Kinds);

template <class Solver, class Matrix>
void expect_solves(Solver& solver, const Matrix& a, const Eigen::MatrixXd& dense) {
  const Eigen::MatrixXd b = Eigen::MatrixXd::Random(a.rows(), 3);
  const Eigen::MatrixXd truth = dense.partialPivLu().solve(b);
  const Eigen::MatrixXd x = solver.solve(b);
  EXPECT_EQ(solver.info(), Eigen::Success) << solver.message();
  EXPECT_LT((x - truth).norm(), 1e-13 * truth.norm() * a.rows());
  const Eigen::VectorXd one = solver.solve(2 * b.col(1));  // an expression
  EXPECT_LT((one - 2 * truth.col(1)).norm(), 1e-12 * truth.norm());
  using Columns = Eigen::SparseMatrix<double, Eigen::ColMajor, typename Matrix::StorageIndex>;
  const Columns sparse = b.sparseView();
  const Columns of_sparse = solver.solve(sparse);
  EXPECT_LT((Eigen::MatrixXd(of_sparse) - truth).norm(), 1e-12 * truth.norm());
}

TYPED_TEST(EigenHeader, SolvesAsDenseSolversDo) {
  const TypeParam a = matrix<TypeParam>(60, false), s = matrix<TypeParam>(60, true);
  EspalierLU<TypeParam> lu(a);
  ASSERT_EQ(lu.info(), Eigen::Success);
  expect_solves(lu, a, Eigen::MatrixXd(a));
  const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(60, -1, 1);
  const Eigen::VectorXd transposed = lu.solveTranspose(b);
  EXPECT_LT((a.transpose() * transposed - b).norm(), 1e-13);
  EspalierLLT<TypeParam> llt(s);
  expect_solves(llt, s, Eigen::MatrixXd(s));
  const TypeParam negative = matrix<TypeParam>(60, true, -1);
  EspalierLDLT<TypeParam> ldlt(negative);
  expect_solves(ldlt, negative, Eigen::MatrixXd(negative));
  EXPECT_EQ(ldlt.factorInfo().negative, 60);
}

TYPED_TEST(EigenHeader, OneTriangleIsRead) {
  const TypeParam s = matrix<TypeParam>(30, true);
  TypeParam spoiled = s;
  for (int k = 0; k + 4 < 30; ++k) spoiled.coeffRef(k, k + 4) = 99;  // above the diagonal
  EspalierLLT<TypeParam> lower(spoiled);
  expect_solves(lower, s, Eigen::MatrixXd(s));
  const TypeParam turned = spoiled.transpose();
  EspalierLLT<TypeParam, Eigen::Upper> upper(turned);
  expect_solves(upper, s, Eigen::MatrixXd(s));
}

TYPED_TEST(EigenHeader, NewValuesForOnePattern) {
  TypeParam a = matrix<TypeParam>(40, false);
  EspalierLU<TypeParam> solver;
  EXPECT_THROW(solver.factorize(a), std::logic_error);
  solver.analyzePattern(a);
  for (int round = 1; round < 4; ++round) {
    a *= 1.5;
    solver.factorize(a);
    expect_solves(solver, a, Eigen::MatrixXd(a));
  }
  a.coeffRef(0, 39) = 1;
  solver.factorize(a);
  EXPECT_EQ(solver.info(), Eigen::InvalidInput);
  EXPECT_NE(solver.message(), "");
  solver.compute(a);  // not compressed
  expect_solves(solver, a, Eigen::MatrixXd(a));
}

TEST(EigenHeader, FailuresAreInfo) {
  using Matrix = Eigen::SparseMatrix<double>;
  const Matrix negative = matrix<Matrix>(20, true, -1);
  EspalierLLT<Matrix> llt(negative);
  EXPECT_EQ(llt.info(), Eigen::NumericalIssue);
  EXPECT_NE(llt.message().find("positive definite"), std::string::npos);
  EXPECT_THROW((void)Eigen::VectorXd(llt.solve(Eigen::VectorXd::Ones(20))), std::logic_error);
  Matrix singular = matrix<Matrix>(20, false);
  for (int k = 0; k < 20; ++k)
    if (singular.coeff(7, k) != 0) singular.coeffRef(7, k) = 0;
  EspalierLU<Matrix> lu(singular);
  EXPECT_EQ(lu.info(), Eigen::NumericalIssue);
  lu.compute(matrix<Matrix>(20, false));
  EXPECT_EQ(lu.info(), Eigen::Success) << lu.message();
  Matrix nan = matrix<Matrix>(20, false);
  nan.coeffRef(3, 3) = std::nan("");
  EXPECT_EQ(lu.compute(nan).info(), Eigen::InvalidInput);
  EXPECT_EQ(lu.compute(Matrix(3, 4)).info(), Eigen::InvalidInput) << "not square";
  EXPECT_THROW(lu.setOption("colour", "red"), std::invalid_argument);
}

// A program that takes its solver as a parameter.
template <class Solver>
double largest_entry(const Eigen::SparseMatrix<double>& a) {
  Solver solver;
  solver.compute(a);
  const Eigen::VectorXd x = solver.solve(Eigen::VectorXd::Ones(a.rows()));
  return x.cwiseAbs().maxCoeff();
}

TEST(EigenHeader, TakesThePlaceOfSparseLU) {
  const auto a = matrix<Eigen::SparseMatrix<double>>(500, false);
  EXPECT_NEAR(largest_entry<EspalierLU<Eigen::SparseMatrix<double>>>(a),
              largest_entry<Eigen::SparseLU<Eigen::SparseMatrix<double>>>(a), 1e-14);
}

}  // namespace
}  // namespace espalier::test
