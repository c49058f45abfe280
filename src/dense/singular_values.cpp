#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "dense/dense.hpp"

namespace espalier::dense {

SingularValues singular_values(const MatrixXd& a) {
  const Eigen::JacobiSVD<MatrixXd> svd(a, Eigen::ComputeFullV | Eigen::ComputeThinU);
  return {svd.singularValues(), svd.matrixU(), svd.matrixV()};
}

RightSingularVectors right_singular_vectors(const MatrixXd& a) {
  const Eigen::BDCSVD<MatrixXd> svd(a, Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

VectorXcd last_right_singular_vector(const MatrixXcd& a) {
  const Eigen::JacobiSVD<MatrixXcd, Eigen::FullPivHouseholderQRPreconditioner> svd(a, Eigen::ComputeFullV);
  return svd.matrixV().col(a.cols() - 1);
}

NearestRotation nearest_rotation(const Eigen::Matrix3d& a) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return {svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose(), svd.singularValues()};
}

Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
}

}  // namespace espalier::dense
