#include <Eigen/QR>
#include <algorithm>

#include "dense/dense.hpp"

namespace espalier::dense {

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

MatrixXcd qr_triangle(const MatrixXcd& a) {
  const Eigen::HouseholderQR<MatrixXcd> qr(a);
  return qr.matrixQR().topRows(std::min(a.rows(), a.cols())).triangularView<Eigen::Upper>();
}

MatrixXd least_squares(const MatrixXd& a, const MatrixXd& b) { return a.completeOrthogonalDecomposition().solve(b); }

VectorXd least_squares(const MatrixXd& a, const VectorXd& b, double dependent) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> decomposition;
  decomposition.setThreshold(dependent);
  return decomposition.compute(a).solve(b);
}

VectorXcd least_squares(const MatrixXcd& a, const VectorXcd& b) { return a.colPivHouseholderQr().solve(b); }

}  // namespace espalier::dense
