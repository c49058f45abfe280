// Derivatives of natural frequencies.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/at.hpp"
#include "dense/dense.hpp"
#include "dynamics/integrators/linearised.hpp"
#include "dynamics/integrators/vibrations.hpp"

namespace espalier::dynamics {

namespace {

struct BorderedPencil {
  SparseMatrix k, m;
};

// K and M with the rows of constraints that stay, which are those of `dropped`.
BorderedPencil bordered_pencil(Equations& equations, const State& state, const std::vector<char>& dropped) {
  const TangentMatrices a = tangent_matrices(equations.system(), state);
  equations.evaluate_constraints(state.t, state.q, {});
  std::vector<Index> rows;
  for (Index i = 0; i < equations.sizes().constraints; ++i)
    if (dropped.empty() || dropped[at(i)] == 0) rows.push_back(i);
  const SparsePattern& phi = equations.system().constraint_pattern();
  const std::vector<double> zeros(equations.phi_q().size(), 0.0);
  return {bordered(a.stiffness, phi, equations.phi_q(), rows), bordered(a.mass, phi, zeros, rows)};
}

// X^T A X of a lower triangle whose duplicates are summed.
Eigen::MatrixXd lower_projected(const SparseMatrix& a, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd ax = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  for (Index j = 0; j < a.cols; ++j)
    for (Offset k = a.col_ptr[at(j)]; k < a.col_ptr[at(j) + 1]; ++k) {
      const Index i = a.row_ind[at(k)];
      ax.row(i) += a.values[at(k)] * x.row(j);
      if (i != j) ax.row(j) += a.values[at(k)] * x.row(i);
    }
  return x.transpose() * ax;
}

SparseMatrix difference(const SparseMatrix& above, const SparseMatrix& below, double step) {
  SparseMatrix d = above;
  for (std::size_t i = 0; i < d.values.size(); ++i) d.values[i] = (above.values[i] - below.values[i]) / (2 * step);
  return d;
}

}  // namespace

FrequencySlopes frequency_slopes(Equations& equations, const State& state, Index count,
                                 const std::vector<PencilSides>& parameters, const Options& solver) {
  constexpr double kEqual = 1e-6;   // relative difference of eigenvalues that count as one
  constexpr double kRigid = 1e-10;  // of the largest: a rigid motion
  const BorderedPencil own = bordered_pencil(equations, state, equations.dropped());
  ModesOptions options;
  options.count = count;
  options.solver = solver;
  const ModesResult found = find_modes(own.k, own.m, options);
  if (!found.status.ok()) throw Error(found.status.code, "initial.modes: " + found.status.message);
  const Eigen::Map<const Eigen::MatrixXd> x(found.vectors.data(), found.n, found.count());
  const std::vector<double>& l = found.eigenvalues;
  const double largest = l.empty() ? 0 : l.back();
  FrequencySlopes out;
  for (const double e : l) out.frequencies.push_back(std::sqrt(std::max(e, 0.0)) / (2 * std::numbers::pi));
  out.derivatives.assign(l.size() * parameters.size(), 0.0);
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    const PencilSides& sides = parameters[p];
    const BorderedPencil below = bordered_pencil(*sides.equations[0], *sides.states[0], equations.dropped());
    const BorderedPencil above = bordered_pencil(*sides.equations[1], *sides.states[1], equations.dropped());
    const SparseMatrix dk = difference(above.k, below.k, sides.step), dm = difference(above.m, below.m, sides.step);
    for (std::size_t first = 0, end = 0; first < l.size(); first = end) {
      end = first + 1;
      while (end < l.size() && l[end] - l[end - 1] <= kEqual * l[end]) ++end;
      if (l[first] <= kRigid * largest) continue;
      const Eigen::MatrixXd group =
          x.middleCols(static_cast<Eigen::Index>(first), static_cast<Eigen::Index>(end - first));
      const Eigen::MatrixXd slope = lower_projected(dk, group) - l[first] * lower_projected(dm, group);
      const Eigen::VectorXd slopes = dense::symmetric_eigenvalues(slope);
      for (std::size_t i = first; i < end; ++i)
        out.derivatives[i * parameters.size() + p] =
            slopes[static_cast<Eigen::Index>(i - first)] / (2 * std::sqrt(l[i]) * 2 * std::numbers::pi);
    }
  }
  return out;
}

}  // namespace espalier::dynamics
