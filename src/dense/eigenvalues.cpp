#include <Eigen/Eigenvalues>

#include "dense/dense.hpp"

namespace espalier::dense {

template <class T>
SpectrumOf<T> hermitian_eigen(const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>> eigen(a);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

template <class T>
VectorXd hermitian_eigenvalues(const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>& a) {
  using Solver = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>>;
  return Solver(a, Eigen::EigenvaluesOnly).eigenvalues();
}

template Spectrum hermitian_eigen(const MatrixXd&);
template SpectrumOf<std::complex<double>> hermitian_eigen(const MatrixXcd&);
template VectorXd hermitian_eigenvalues(const MatrixXd&);
template VectorXd hermitian_eigenvalues(const MatrixXcd&);

Spectrum symmetric_eigen(const MatrixXd& a) { return hermitian_eigen(a); }
VectorXd symmetric_eigenvalues(const MatrixXd& a) { return hermitian_eigenvalues(a); }

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
