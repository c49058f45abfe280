#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "dense/dense.hpp"

namespace espalier::dense {

namespace {

/// Eigen's own reductions of other shapes to squares take a compiler ten times as long as the rotations.
template <class Matrix>
using OfSquare = Eigen::JacobiSVD<Matrix, Eigen::NoQRPreconditioner>;

/// A P = Q R, the longest columns first.
struct PivotedQr {
  Eigen::VectorXi order;
  MatrixXd q, r;

  explicit PivotedQr(const MatrixXd& a) : order(pivoted_columns(a, 0).order) {
    auto [orthogonal, triangle] = qr_factors(a(Eigen::all, order));
    q = std::move(orthogonal);
    r = std::move(triangle);
  }
};

/// U (m x m) and V of a matrix with as many rows as columns, or more.
SingularValues whole_singular_values(const MatrixXd& a) {
  const Eigen::Index n = a.cols();
  if (a.rows() == n) {
    const OfSquare<MatrixXd> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
    return {svd.singularValues(), svd.matrixU(), svd.matrixV()};
  }
  PivotedQr qr(a);
  const SingularValues of_r = whole_singular_values(qr.r);
  SingularValues s{of_r.values, std::move(qr.q), MatrixXd(n, n)};
  s.u.leftCols(n) = times(s.u.leftCols(n), of_r.u);
  for (Eigen::Index k = 0; k < n; ++k) s.v.row(qr.order[k]) = of_r.v.row(k);
  return s;
}

/// x, y := c x - s y, s x + c y
void rotate(double* x, double* y, Eigen::Index n, double c, double s) {
  for (Eigen::Index k = 0; k < n; ++k) {
    const double before = x[k];
    x[k] = c * before - s * y[k];
    y[k] = s * before + c * y[k];
  }
}

/// Makes columns of X = A V orthogonal to each other by rotations of pairs (Hestenes 1958), to the rounding of the
/// longest.
void rotate_to_orthogonal(MatrixXd& x, MatrixXd& v) {
  constexpr int kMostSweeps = 60;
  const Eigen::Index n = x.cols();
  bool rotated = true;
  for (int sweep = 0; sweep < kMostSweeps && rotated; ++sweep) {
    rotated = false;
    const MatrixXd gram = transposed_times(x, x);
    const VectorXd length = gram.diagonal().cwiseSqrt();
    const double rounding = 4 * std::numeric_limits<double>::epsilon() * length.maxCoeff();
    for (Eigen::Index j = 1; j < n; ++j)
      for (Eigen::Index i = 0; i < j; ++i) {
        if (!(std::abs(gram(i, j)) > rounding * std::max(length[i], length[j]))) continue;
        const double a = x.col(i).squaredNorm(), b = x.col(j).squaredNorm(), product = x.col(i).dot(x.col(j));
        if (product == 0) continue;
        rotated = true;
        const double zeta = (b - a) / (2 * product);
        const double t = std::copysign(1 / (std::abs(zeta) + std::hypot(1.0, zeta)), zeta), c = 1 / std::hypot(1.0, t);
        rotate(&x(0, i), &x(0, j), x.rows(), c, c * t);
        rotate(&v(0, i), &v(0, j), n, c, c * t);
      }
  }
}

}  // namespace

SingularValues singular_values(const MatrixXd& a) {
  const bool turned = a.rows() < a.cols();
  SingularValues s = whole_singular_values(turned ? MatrixXd(a.transpose()) : a);
  if (turned) std::swap(s.u, s.v);
  s.u = MatrixXd(s.u.leftCols(s.values.size()));
  return s;
}

// The eigenvectors of A^T A, which know values to half of the digits; rotations give the others.
RightSingularVectors right_singular_vectors(const MatrixXd& a) {
  const double scale = a.size() == 0 ? 0 : a.cwiseAbs().maxCoeff();
  const MatrixXd scaled = scale > 0 ? MatrixXd(a / scale) : a;
  MatrixXd v = symmetric_eigen(transposed_times(scaled, scaled)).vectors, x = times(scaled, v);
  rotate_to_orthogonal(x, v);
  const VectorXd length = scale * x.colwise().norm().transpose();
  std::vector<Eigen::Index> order(static_cast<std::size_t>(length.size()));
  std::iota(order.begin(), order.end(), Eigen::Index{0});
  std::sort(order.begin(), order.end(), [&](Eigen::Index i, Eigen::Index j) { return length[i] > length[j]; });
  return {length(order).head(std::min(a.rows(), a.cols())), v(Eigen::all, order)};
}

VectorXcd last_right_singular_vector(const MatrixXcd& a) {
  return OfSquare<MatrixXcd>(a, Eigen::ComputeFullV).matrixV().col(a.cols() - 1);
}

NearestRotation nearest_rotation(const Eigen::Matrix3d& a) {
  const OfSquare<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d turn = svd.matrixU() * svd.matrixV().transpose();
  const Eigen::Vector3d signs(1, 1, turn.col(0).cross(turn.col(1)).dot(turn.col(2)) < 0 ? -1 : 1);
  return {svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose(), svd.singularValues()};
}

// As Quaternion::FromTwoVectors(), whose decomposition of a 2 x 3 matrix takes seconds to compile.
Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const double cosine = b.dot(a);
  if (cosine < -1 + Eigen::NumTraits<double>::dummy_precision()) {  // any axis across them
    MatrixXd both(2, 3);
    both << a.transpose(), b.transpose();
    const Eigen::Vector3d axis = null_space(both / both.cwiseAbs().maxCoeff(), 0.5).rightCols<1>();
    const double w = (1 + std::max(cosine, -1.0)) * 0.5;
    const Eigen::Vector3d v = axis * std::sqrt(1 - w);
    return Eigen::Quaterniond(std::sqrt(w), v.x(), v.y(), v.z()).toRotationMatrix();
  }
  const double s = std::sqrt((1 + cosine) * 2);
  const Eigen::Vector3d v = a.cross(b) * (1 / s);
  return Eigen::Quaterniond(s * 0.5, v.x(), v.y(), v.z()).toRotationMatrix();
}

}  // namespace espalier::dense
