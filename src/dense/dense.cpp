#include "dense/dense.hpp"

#include <Eigen/Dense>

namespace espalier::dense {

MatrixXd times(const MatrixXd& a, const MatrixXd& b) { return a * b; }
MatrixXd transposed_times(const MatrixXd& a, const MatrixXd& b) { return a.transpose() * b; }

Spectrum symmetric_eigen(const MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(a);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

VectorXd symmetric_eigenvalues(const MatrixXd& a) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

Eigen::Vector3d principal_values(const Eigen::Matrix3d& a) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

Spectrum symmetric_eigen(const MatrixXd& a, const MatrixXd& b) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> eigen(a, b);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

ComplexSpectrum general_eigen(const MatrixXd& a) {
  const Eigen::EigenSolver<MatrixXd> eigen(a);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

SingularValues singular_values(const MatrixXd& a) {
  const Eigen::JacobiSVD<MatrixXd> svd(a, Eigen::ComputeFullV | Eigen::ComputeThinU);
  return {svd.singularValues(), svd.matrixU(), svd.matrixV()};
}

NearestRotation nearest_rotation(const Eigen::Matrix3d& a) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return {svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose(), svd.singularValues()};
}

void divide_by_upper_cholesky(const MatrixXd& b, MatrixXd& x) {
  const Eigen::LLT<MatrixXd> factor(b);
  factor.matrixU().solveInPlace<Eigen::OnTheRight>(x);
}

PivotedColumns pivoted_columns(const MatrixXd& a, double dependent) {
  Eigen::ColPivHouseholderQR<MatrixXd> qr(a);
  qr.setThreshold(dependent);
  return {qr.colsPermutation().indices(), qr.rank()};
}

MatrixXd null_space(const MatrixXd& rows, double dependent) {
  const Eigen::Index n = rows.cols();
  if (rows.rows() == 0) return MatrixXd::Identity(n, n);
  Eigen::ColPivHouseholderQR<MatrixXd> qr(rows.transpose());
  qr.setThreshold(dependent);
  const MatrixXd q = qr.householderQ() * MatrixXd::Identity(n, n);
  return q.rightCols(n - qr.rank());
}

QrFactors qr_factors(const MatrixXd& a) {
  const Eigen::HouseholderQR<MatrixXd> qr(a);
  return {qr.householderQ() * MatrixXd::Identity(a.rows(), a.rows()),
          qr.matrixQR().topRows(std::min(a.rows(), a.cols())).triangularView<Eigen::Upper>()};
}

MatrixXd qr_triangle(const MatrixXd& a) {
  const Eigen::HouseholderQR<MatrixXd> qr(a);
  return qr.matrixQR().topRows(std::min(a.rows(), a.cols())).triangularView<Eigen::Upper>();
}

VectorXd least_squares(const MatrixXd& a, const VectorXd& b, double dependent) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> decomposition;
  decomposition.setThreshold(dependent);
  return decomposition.compute(a).solve(b);
}

Eigen::VectorXi completely_pivoted_columns(const MatrixXd& a) {
  return Eigen::FullPivLU<MatrixXd>(a).permutationQ().indices();
}

VectorXd solve_by_complete_pivoting(const MatrixXd& a, const VectorXd& b) {
  return Eigen::FullPivLU<MatrixXd>(a).solve(b);
}

bool solve_definite(const MatrixXd& a, MatrixXd& x) {
  const Eigen::LDLT<MatrixXd> factor(a);
  if (factor.info() != Eigen::Success || !factor.isPositive() || !(factor.vectorD().minCoeff() > 0)) return false;
  x = factor.solve(x).eval();
  return true;
}

struct Lu::Factor {
  Eigen::PartialPivLU<MatrixXd> lu;
};

Lu::Lu() : factor_(std::make_unique<Factor>()) {}
Lu::Lu(const MatrixXd& a) : Lu() { compute(a); }
Lu::~Lu() = default;
Lu::Lu(Lu&&) noexcept = default;
Lu& Lu::operator=(Lu&&) noexcept = default;

void Lu::compute(const MatrixXd& a) { factor_->lu.compute(a); }
MatrixXd Lu::solve(const MatrixXd& b) const { return factor_->lu.solve(b); }

void Lu::solve(const Eigen::Ref<const VectorXd>& b, Eigen::Ref<VectorXd> x) const {
  const auto& lu = factor_->lu;
  x.noalias() = lu.permutationP() * b;
  lu.matrixLU().triangularView<Eigen::UnitLower>().solveInPlace(x);
  lu.matrixLU().triangularView<Eigen::Upper>().solveInPlace(x);
}

VectorXd Lu::pivots() const { return factor_->lu.matrixLU().diagonal(); }
int Lu::permutation_sign() const { return factor_->lu.permutationP().determinant() < 0 ? -1 : 1; }
double Lu::rcond() const { return factor_->lu.rcond(); }

}  // namespace espalier::dense
