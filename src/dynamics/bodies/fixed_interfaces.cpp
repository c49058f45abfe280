#include "dynamics/bodies/fixed_interfaces.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/bodies/rotation.hpp"
#include "espalier/modes.hpp"

namespace espalier::dynamics::fixed_interfaces {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// The lower triangle of [A R^T; R 0].
SparseMatrix bordered_lower(const SparseMatrix& a, const MatrixXd& rows) {
  SparseMatrix out;
  const auto m = static_cast<Index>(rows.rows());
  out.rows = out.cols = a.cols + m;
  out.storage = Storage::symmetric_lower;
  out.col_ptr.push_back(0);
  for (Index j = 0; j < out.cols; ++j) {
    for (Offset k = j < a.cols ? a.col_ptr[at(j)] : 0; j < a.cols && k < a.col_ptr[at(j) + 1]; ++k)
      if (a.row_ind[at(k)] >= j && a.values[at(k)] != 0) {
        out.row_ind.push_back(a.row_ind[at(k)]);
        out.values.push_back(a.values[at(k)]);
      }
    for (Index i = 0; i < m && j < a.cols; ++i)
      if (rows(i, j) != 0) {
        out.row_ind.push_back(a.cols + i);
        out.values.push_back(rows(i, j));
      }
    out.col_ptr.push_back(static_cast<Offset>(out.row_ind.size()));
  }
  return out;
}

void check(const Status& status, const std::string& what) {
  if (!status.ok()) throw Error(status.code, what + ": " + status.message);
}

}  // namespace

MatrixXd product(const SparseMatrix& a, const MatrixXd& x) {
  MatrixXd y = MatrixXd::Zero(x.rows(), x.cols());
  for (Eigen::Index c = 0; c < x.cols(); ++c)
    for (Index j = 0; j < a.cols; ++j)
      for (Offset k = a.col_ptr[at(j)]; k < a.col_ptr[at(j) + 1]; ++k)
        y(a.row_ind[at(k)], c) += a.values[at(k)] * x(j, c);
  return y;
}

SparseMatrix reference_matrix(AssembledSystem& system, const FlexibleBody& body, const TangentWeights& weights) {
  SparseMatrix a;
  const SparsePattern& p = system.tangent_pattern();
  a.rows = a.cols = p.cols;
  a.col_ptr = p.ptr;
  a.row_ind = p.ind;
  a.values.resize(at(p.nonzeros()));
  const std::vector<double> rest(body.reference().size(), 0.0);
  system.tangent({0, body.reference(), rest, rest, {}}, weights, a.values);
  return a;
}

Rigid::Rigid(const FlexibleBody& body, const SparseMatrix& mass, const std::string& name) : mass_(mass) {
  const Index n = mass.cols;
  MatrixXd shift = MatrixXd::Zero(n, 3);
  Eigen::Map<const Eigen::Matrix3Xd> x(body.reference().data(), 3, n / 3);
  for (Index v = 0; v < n / 3; v += body.vertices_per_node()) shift.middleRows(3 * v, 3).setIdentity();
  const MatrixXd weighted = product(mass, shift);
  const Mat3 total = dense::transposed_times(shift, weighted);
  const Eigen::Map<const VectorXd> all(body.reference().data(), n);
  centre = (weighted.transpose() * all) / total(0, 0);
  motions = MatrixXd(n, 6);
  motions.leftCols(3) = shift;
  for (Index v = 0; v < n / 3; ++v) {
    const bool place = v % body.vertices_per_node() == 0;
    motions.block(3 * v, 3, 3, 3) = -skew(place ? Vec3(x.col(v) - centre) : Vec3(x.col(v)));
  }
  const Eigen::Matrix<double, 6, 6> gram = dense::transposed_times(motions, product(mass, motions));
  const Vec3 inertia = dense::principal_values(gram.bottomRightCorner<3, 3>());
  if (!(inertia[0] > 1e-10 * inertia[2]))
    throw Error(StatusCode::invalid_input,
                fmt::format("'{}' has no inertia about an axis (a straight cable?), so it cannot be reduced; leave "
                            "'reduce' out",
                            name));
  dense::divide_by_upper_cholesky(gram, motions);
}

void Rigid::remove_from(MatrixXd& x) const {
  for (int pass = 0; pass < 2; ++pass) x -= dense::times(motions, dense::transposed_times(motions, product(mass_, x)));
}

MatrixXd supports(const MatrixXd& rows, const MatrixXd& rigid) {
  MatrixXd scaled = rigid;
  for (int k = 0; k < 6; ++k) scaled.col(k) /= rigid.col(k).cwiseAbs().maxCoeff();
  MatrixXd left = MatrixXd::Identity(6, 6);  // rigid motions that the interfaces leave free
  if (rows.rows() > 0) {
    const auto [s, u, v] = dense::singular_values(dense::times(rows, scaled));
    const auto rank = (s.array() > kDependent * s[0]).count();
    left = v.rightCols(6 - rank);
  }
  MatrixXd result = MatrixXd::Zero(left.cols(), rigid.rows());
  if (left.cols() == 0) return result;
  const Eigen::VectorXi order = dense::pivoted_columns(dense::times(scaled, left).transpose(), kDependent).order;
  for (Eigen::Index i = 0; i < left.cols(); ++i) result(i, order[i]) = 1;
  return result;
}

MatrixXd static_shapes(const SparseMatrix& stiffness, const MatrixXd& rows, const MatrixXd& held, const MatrixXd& loads,
                       const Options& solver) {
  const Eigen::Index n = stiffness.cols, m = rows.rows(), count = m + loads.cols();
  if (count == 0) return MatrixXd(n, 0);
  MatrixXd all(m + held.rows(), n);
  all << rows, held * stiffness.values.front();
  const SparseMatrix k = bordered_lower(stiffness, all);
  Options options = solver;
  options.kind = Kind::ldlt;
  Solver factor(options);
  check(factor.analyze(k).status, "static shapes");
  check(factor.factorize(k).status, "static shapes");
  MatrixXd b = MatrixXd::Zero(k.cols, count);
  b.block(n, 0, m, m).setIdentity();
  b.topRightCorner(n, loads.cols()) = loads;
  check(factor
            .solve({b.data(), static_cast<std::size_t>(b.size())}, {b.data(), static_cast<std::size_t>(b.size())},
                   static_cast<Index>(count))
            .status,
        "static shapes");
  return b.topRows(n);
}

MatrixXd normal_modes(const SparseMatrix& mass, const SparseMatrix& stiffness, const MatrixXd& rows, Index free,
                      const ReductionOptions& options, const Options& solver) {
  ModesOptions wanted;
  wanted.solver = solver;
  wanted.check_mass = false;  // of a mesh whose elements were checked
  if (std::isfinite(options.modes)) wanted.count = static_cast<Index>(options.modes) + free;
  const double omega = 2 * std::numbers::pi * options.frequency;
  wanted.below = omega * omega;
  if (options.modes == 0) return MatrixXd(mass.cols, 0);
  const ModesResult found =
      find_modes(bordered_lower(stiffness, rows), bordered_lower(mass, MatrixXd::Zero(rows.rows(), mass.cols)), wanted);
  check(found.status, "modes with the interfaces at rest");
  return Eigen::Map<const MatrixXd>(found.vectors.data(), found.n, found.count()).topRows(mass.cols);
}

void make_unique_basis(const VectorXd& squares, MatrixXd& shapes) {
  constexpr double kEqual = 1e-9;
  for (Eigen::Index first = 0, end = 0; first < squares.size(); first = end) {
    end = first + 1;
    while (end < squares.size() && squares[end] - squares[end - 1] <= kEqual * squares[end]) ++end;
    const Eigen::Index count = end - first;
    MatrixXd weights(shapes.rows(), count);
    for (Eigen::Index i = 0; i < weights.rows(); ++i)
      for (Eigen::Index c = 0; c < count; ++c)
        weights(i, c) = std::cos(static_cast<double>(i) * (1 + 0.37 * static_cast<double>(c)));
    const MatrixXd shares = dense::transposed_times(shapes.middleCols(first, count), weights);
    auto [turn, r] = dense::qr_factors(shares);
    for (Eigen::Index i = 0; i < count; ++i)
      if (r(i, i) < 0) turn.col(i) *= -1;
    shapes.middleCols(first, count) = dense::times(shapes.middleCols(first, count), turn);
  }
}

}  // namespace espalier::dynamics::fixed_interfaces
