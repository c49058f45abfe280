#include <Eigen/Eigenvalues>

#include "dense/dense.hpp"

namespace espalier::dense {

Spectrum symmetric_eigen(const MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(a);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

SpectrumOf<std::complex<double>> symmetric_eigen(const MatrixXcd& a) {
  const Eigen::SelfAdjointEigenSolver<MatrixXcd> eigen(a);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

VectorXd symmetric_eigenvalues(const MatrixXd& a) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

VectorXd symmetric_eigenvalues(const MatrixXcd& a) {
  return Eigen::SelfAdjointEigenSolver<MatrixXcd>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

Eigen::Vector3d principal_values(const Eigen::Matrix3d& a) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

PrincipalAxes principal_axes(const Eigen::Matrix3d& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(a);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

Spectrum symmetric_eigen(const MatrixXd& a, const MatrixXd& b) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> eigen(a, b);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

ComplexSpectrum general_eigen(const MatrixXd& a) {
  const Eigen::EigenSolver<MatrixXd> eigen(a);
  if (eigen.info() != Eigen::Success) return {{}, {}, false};
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

VectorXcd general_eigenvalues(const MatrixXd& a) { return a.eigenvalues(); }

ComplexSpectrum general_eigen(const MatrixXcd& a) {
  const Eigen::ComplexEigenSolver<MatrixXcd> eigen(a);
  if (eigen.info() != Eigen::Success) return {{}, {}, false};
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

VectorXcd general_eigenvalues(const MatrixXcd& a) {
  return Eigen::ComplexEigenSolver<MatrixXcd>(a, false).eigenvalues();
}

}  // namespace espalier::dense
