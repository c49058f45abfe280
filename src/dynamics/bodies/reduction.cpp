#include "dynamics/bodies/reduction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/bodies/fixed_interfaces.hpp"

namespace espalier::dynamics {
namespace {

using namespace fixed_interfaces;
using Eigen::MatrixXd;

constexpr double kSpanned = 1e-12;    // share of a shape's mass beside rigid motion and the shapes before it
constexpr double kLoose = 1e-12;      // square of a frequency over the largest one: nothing holds it
constexpr double kGradientArm = 0.1;  // gradients have no unit: they count as points at a part of the body's size
constexpr Index kMostDense = 2000;    // unknowns of a body whose modes are all kept

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

/// Shapes that are orthogonal in the stiffness, too, each with 1 as its largest displacement.
ReducedBasis scaled_shapes(const FlexibleBody& body, const SparseMatrix& stiffness, const MatrixXd& x) {
  ReducedBasis out;
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

SparseMatrix NodalBody::matrix(const TangentWeights& weights) { return reference_matrix(system_, *body_, weights); }

ReducedBasis reduce(NodalBody& nodal, std::span<const FlexibleFrame* const> interfaces, const MatrixXd& loads,
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
  ReducedBasis out = scaled_shapes(body, stiffness, orthonormal(mass, rigid, std::move(all)));
  out.centre = rigid.centre;
  out.from_interfaces = std::max<Index>(0, static_cast<Index>(out.mass.size() - modes.cols()));
  return out;
}

}  // namespace espalier::dynamics
