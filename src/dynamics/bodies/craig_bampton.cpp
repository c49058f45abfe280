#include "dynamics/bodies/craig_bampton.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dense/dense.hpp"
#include "dynamics/bodies/fixed_interfaces.hpp"

namespace espalier::dynamics {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// b = rows x, and the interface that each row belongs to.
struct InterfaceRows {
  MatrixXd rows;
  std::vector<std::size_t> owner;
};

InterfaceRows rows_of(const FlexibleBody& body, std::span<const FlexibleFrame* const> frames) {
  const auto n = static_cast<Eigen::Index>(body.reference().size());
  InterfaceRows out;
  for (std::size_t f = 0; f < frames.size(); ++f)
    out.owner.insert(out.owner.end(), frames[f]->has_rotation() ? 6 : 3, f);
  out.rows = MatrixXd::Zero(static_cast<Eigen::Index>(out.owner.size()), n);
  Eigen::Index first = 0;
  for (const FlexibleFrame* frame : frames) {
    const auto coordinates = frame->coordinates();
    const int count = frame->has_rotation() ? 6 : 3;
    MatrixXd j(6, coordinates.size());
    frame->jacobian(body.reference(), j.data());
    for (std::size_t k = 0; k < coordinates.size(); ++k)
      out.rows.col(coordinates[k]).segment(first, count) += j.col(static_cast<Eigen::Index>(k)).head(count);
    first += count;
  }
  return out;
}

void check_independent(const InterfaceRows& interfaces, const MatrixXd& unit_rows, std::span<const std::string> names) {
  const dense::PivotedColumns columns = dense::pivoted_columns(unit_rows.transpose(), fixed_interfaces::kDependent);
  if (columns.rank == unit_rows.rows()) return;
  const std::string& name = names[interfaces.owner[at(columns.order[columns.rank])]];
  throw Error(StatusCode::invalid_input,
              fmt::format("the interface '{}' moves with the others (they share nodes, or it lies between nodes that "
                          "they hold), so its motion cannot be given by itself; leave it out, or take other nodes",
                          name));
}

/// What rounding leaves beside symmetry.
MatrixXd symmetric(const MatrixXd& a) { return 0.5 * (a + a.transpose()); }

}  // namespace

CraigBampton craig_bampton(const FlexibleBody& body, const SparseMatrix& mass, const SparseMatrix& stiffness,
                           std::span<const FlexibleFrame* const> interfaces, std::span<const std::string> names,
                           const ReductionOptions& options, const Options& solver) {
  using namespace fixed_interfaces;
  if (interfaces.empty())
    throw Error(
        StatusCode::invalid_input,
        fmt::format(
            "'{}' needs an interface, where other programs hold on to it: name frames on it (markers, or a frame of "
            "a joint as \"hinge.b\"), or give it a joint or a force",
            body.name()));
  if (!std::isfinite(options.modes) && !std::isfinite(options.frequency))
    throw Error(StatusCode::invalid_input,
                fmt::format("'{}' needs a number of modes, or a frequency below which they are kept", body.name()));
  const InterfaceRows places = rows_of(body, interfaces);
  const VectorXd size = places.rows.rowwise().norm();
  const MatrixXd rows = size.cwiseInverse().asDiagonal() * places.rows;
  check_independent(places, rows, names);
  const Rigid rigid(body, mass, body.name());
  const MatrixXd held = supports(rows, rigid.motions);
  ReductionOptions wanted = options;
  const auto free = static_cast<Index>(held.rows());
  wanted.modes = std::min(wanted.modes, static_cast<double>(std::max<Eigen::Index>(0, mass.cols - rows.rows() - free)));
  if (free > 0 && wanted.modes == 0)
    throw Error(
        StatusCode::invalid_input,
        fmt::format("the interfaces of '{}' leave {} of its rigid motions free, which only modes can have; keep "
                    "a mode at least, or take interfaces with axes (faces, bores, three nodes and more)",
                    body.name(), free));
  MatrixXd fixed = static_shapes(stiffness, rows, held, MatrixXd(mass.cols, 0), solver);
  fixed *= size.cwiseInverse().asDiagonal();
  MatrixXd modes = normal_modes(mass, stiffness, rows, free, wanted, solver);

  const Eigen::Index b = fixed.cols(), m = modes.cols();
  CraigBampton out;
  out.squares = modes.cwiseProduct(product(stiffness, modes)).colwise().sum().transpose();
  for (Eigen::Index k = 0; k < std::min<Eigen::Index>(free, m); ++k) out.squares[k] = 0;  // rigid, but for rounding
  make_unique_basis(out.squares, modes);
  out.shapes.resize(mass.cols, b + m);
  out.shapes << fixed, modes;
  const MatrixXd weighted = product(mass, out.shapes);
  out.mass = symmetric(dense::transposed_times(out.shapes, weighted));
  out.mass.bottomRightCorner(m, m).setIdentity();
  out.stiffness = MatrixXd::Zero(b + m, b + m);
  out.stiffness.topLeftCorner(b, b) = symmetric(dense::transposed_times(fixed, product(stiffness, fixed)));
  out.stiffness.diagonal().tail(m) = out.squares;
  return out;
}

}  // namespace espalier::dynamics
