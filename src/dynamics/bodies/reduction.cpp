#include "dynamics/bodies/reduction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/bodies/rotation.hpp"
#include "espalier/modes.hpp"

namespace espalier::dynamics {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kDependent = 1e-8;   // rows of interfaces that depend on others, relative
constexpr double kSpanned = 1e-12;    // share of a shape's mass beside rigid motion and the shapes before it
constexpr double kLoose = 1e-12;      // square of a frequency over the largest one: nothing holds it
constexpr double kGradientArm = 0.1;  // gradients have no unit: they count as points at a part of the body's size
constexpr Index kMostDense = 2000;    // unknowns of a body whose modes are all kept

MatrixXd product(const SparseMatrix& a, const MatrixXd& x) {
  MatrixXd y = MatrixXd::Zero(x.rows(), x.cols());
  for (Eigen::Index c = 0; c < x.cols(); ++c)
    for (Index j = 0; j < a.cols; ++j)
      for (Offset k = a.col_ptr[at(j)]; k < a.col_ptr[at(j) + 1]; ++k)
        y(a.row_ind[at(k)], c) += a.values[at(k)] * x(j, c);
  return y;
}

/// Motions of a body with its mass, and with the six rigid ones taken out of them.
class Rigid {
 public:
  Rigid(const FlexibleBody& body, const SparseMatrix& mass, const std::string& name) : mass_(mass) {
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
  /// Twice, against rounding.
  void remove_from(MatrixXd& x) const {
    for (int pass = 0; pass < 2; ++pass)
      x -= dense::times(motions, dense::transposed_times(motions, product(mass_, x)));
  }

  Vec3 centre;
  MatrixXd motions;  ///< orthonormal in the mass

 private:
  const SparseMatrix& mass_;
};

/// Rows that are zero where the interfaces are at rest; independent of each other.
MatrixXd interface_rows(const FlexibleBody& body, std::span<const FlexibleFrame* const> frames, double length) {
  const auto n = static_cast<Eigen::Index>(body.reference().size());
  std::vector<Eigen::RowVectorXd> rows;
  for (const FlexibleFrame* frame : frames) {
    const auto coordinates = frame->coordinates();
    MatrixXd j(6, coordinates.size());
    frame->jacobian(body.reference(), j.data());
    for (int i = 0; i < (frame->has_rotation() ? 6 : 3); ++i) {
      rows.emplace_back(Eigen::RowVectorXd::Zero(n));
      for (std::size_t k = 0; k < coordinates.size(); ++k)
        rows.back()[coordinates[k]] += (i < 3 ? 1 : length) * j(i, static_cast<Eigen::Index>(k));
    }
  }
  if (rows.empty()) return MatrixXd(0, n);
  MatrixXd transposed(n, static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i)
    transposed.col(static_cast<Eigen::Index>(i)) = rows[i].transpose().normalized();
  const dense::PivotedColumns columns = dense::pivoted_columns(transposed, kDependent);
  MatrixXd result(columns.rank, n);
  for (Eigen::Index i = 0; i < columns.rank; ++i) result.row(i) = transposed.col(columns.order[i]).transpose();
  return result;
}

/// Single coordinates that, together with the interfaces at rest, hold the body without straining it.
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

/// Unit motions of each interface row with the others at rest, then loads with all at rest.
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

/// All motions of a small body, and none of a larger one unless they are all asked for.
MatrixXd all_motions(const SparseMatrix& mass, const SparseMatrix& stiffness, const std::string& name) {
  const Index n = mass.cols;
  if (n > kMostDense)
    throw Error(
        StatusCode::invalid_input,
        fmt::format("all modes of '{}' with its {} unknowns are too many; give 'modes' or 'frequency'", name, n));
  const MatrixXd unit = MatrixXd::Identity(n, n);
  return dense::symmetric_eigen(product(stiffness, unit), product(mass, unit)).vectors;
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

/// Orthonormal in the mass, without rigid motion; what depends on others is dropped.
MatrixXd orthonormal(const SparseMatrix& mass, const Rigid& rigid, MatrixXd x) {
  for (Eigen::Index k = 0; k < x.cols(); ++k) x.col(k) /= std::sqrt(x.col(k).dot(product(mass, x.col(k)).col(0)));
  rigid.remove_from(x);
  for (int pass = 0; pass < 2; ++pass) {
    const auto [size, vectors] = dense::symmetric_eigen(dense::transposed_times(x, product(mass, x)));
    const Eigen::Index kept = (size.array() > kSpanned).count();
    x = dense::times(x, vectors.rightCols(kept) * size.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal());
    rigid.remove_from(x);
  }
  return x;
}

/// Signs, and the directions of shapes that share a frequency, are left open by an eigenvalue problem. Here they follow
/// from fixed weights of the nodes, so that they do not jump with a parameter of the mesh, nor with rounding: in each
/// group, shape i has none of the weights 0 to i - 1 and a positive share of weight i.
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

/// Shapes that are orthogonal in the stiffness, too, each with 1 as its largest displacement.
ReducedShapes scaled_shapes(const FlexibleBody& body, const SparseMatrix& stiffness, const MatrixXd& x) {
  ReducedShapes out;
  out.mass.resize(x.cols());
  out.stiffness.resize(x.cols());
  out.shapes.resize(x.rows(), x.cols());
  if (x.cols() == 0) return out;
  const MatrixXd k = dense::transposed_times(x, product(stiffness, x));
  const auto [squares, vectors] = dense::symmetric_eigen(0.5 * (k + k.transpose()));
  if (!(squares[0] > kLoose * squares[squares.size() - 1]))
    throw Error(StatusCode::invalid_input,
                fmt::format("'{}' has shapes without stiffness (pieces that share no node, elements that hold together "
                            "at an edge, cables without bending), so it cannot be reduced; make each piece a body",
                            body.name()));
  out.shapes = dense::times(x, vectors);
  make_unique_basis(squares, out.shapes);
  for (Eigen::Index k2 = 0; k2 < x.cols(); ++k2) {
    auto shape = out.shapes.col(k2);
    double most = 0;
    for (Index v = 0; v < body.vertices(); ++v) {
      const double arm = v % body.vertices_per_node() == 0 ? 1 : kGradientArm * body.size();
      most = std::max(most, arm * shape.segment<3>(3 * v).norm());
    }
    const double scale = 1 / most;
    shape *= scale;
    out.mass[k2] = scale * scale;
    out.stiffness[k2] = squares[k2] * scale * scale;
  }
  return out;
}

}  // namespace

NodalBody::NodalBody(std::unique_ptr<FlexibleBody> body) : body_(&system_.add(std::move(body))) { system_.finish(); }

SparseMatrix NodalBody::matrix(const TangentWeights& weights) {
  SparseMatrix a;
  const SparsePattern& p = system_.tangent_pattern();
  a.rows = a.cols = p.cols;
  a.col_ptr = p.ptr;
  a.row_ind = p.ind;
  a.values.resize(at(p.nonzeros()));
  const std::vector<double> rest(body_->reference().size(), 0.0);
  system_.tangent({0, body_->reference(), rest, rest, {}}, weights, a.values);
  return a;
}

ReducedShapes reduce(NodalBody& nodal, std::span<const FlexibleFrame* const> interfaces, const MatrixXd& loads,
                     const ReductionOptions& options, const Options& solver) {
  const FlexibleBody& body = nodal.body();
  const SparseMatrix mass = nodal.mass(), stiffness = nodal.stiffness();
  if (body.inverted_element() >= 0)
    throw Error(StatusCode::invalid_input,
                fmt::format("element {} of '{}' is inverted in the mesh", body.inverted_element(), body.name()));
  const Rigid rigid(body, mass, body.name());
  const double length = body.size();
  const MatrixXd rows = interface_rows(body, interfaces, length);
  MatrixXd fixed, modes;
  if (options.modes + static_cast<double>(rows.rows()) >= mass.cols && !std::isfinite(options.frequency)) {
    modes = all_motions(mass, stiffness, body.name());
    fixed = MatrixXd(mass.cols, 0);
  } else {
    const MatrixXd held = supports(rows, rigid.motions);
    MatrixXd balanced = loads;  // what no interface takes goes into the inertia of the body
    if (held.rows() > 0 && loads.cols() > 0)
      balanced -= product(mass, dense::times(rigid.motions, dense::transposed_times(rigid.motions, loads)));
    fixed = static_shapes(stiffness, rows, held, balanced, solver);
    modes = normal_modes(mass, stiffness, rows, static_cast<Index>(held.rows()), options, solver);
  }
  MatrixXd all(mass.cols, fixed.cols() + modes.cols());
  all << fixed, modes;
  ReducedShapes out = scaled_shapes(body, stiffness, orthonormal(mass, rigid, std::move(all)));
  out.centre = rigid.centre;
  out.from_interfaces = std::max<Index>(0, static_cast<Index>(out.mass.size() - modes.cols()));
  return out;
}

}  // namespace espalier::dynamics
