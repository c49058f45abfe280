#include "dynamics/integrators/vibrations.hpp"

#include <fmt/format.h>

#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "dense/dense.hpp"
#include "dynamics/integrators/linearised.hpp"

namespace espalier::dynamics {

namespace {

std::size_t vibration_at(Offset i) { return static_cast<std::size_t>(i); }

// The symmetric part of A as a lower triangle, bordered by rows of constraints; every entry twice, halved, which is
// summed up by whoever reads it.
SparseMatrix bordered(const SparseMatrix& a, const SparsePattern& phi, ConstSpan values,
                      const std::vector<Index>& rows) {
  struct Entry {
    Index row;
    double value;
  };
  std::vector<std::vector<Entry>> columns(vibration_at(a.cols) + rows.size());
  for (Index j = 0; j < a.cols; ++j)
    for (Offset k = a.col_ptr[vibration_at(j)]; k < a.col_ptr[vibration_at(j) + 1]; ++k) {
      const Index i = a.row_ind[vibration_at(k)];
      const double half = 0.5 * a.values[vibration_at(k)];
      columns[vibration_at(std::min(i, j))].push_back({std::max(i, j), i == j ? 2 * half : half});
    }
  for (std::size_t r = 0; r < rows.size() && !values.empty(); ++r)
    for (Offset k = phi.ptr[vibration_at(rows[r])]; k < phi.ptr[vibration_at(rows[r]) + 1]; ++k)
      columns[vibration_at(phi.ind[vibration_at(k)])].push_back(
          {a.cols + static_cast<Index>(r), values[vibration_at(k)]});
  SparseMatrix out;
  out.rows = out.cols = static_cast<Index>(columns.size());
  out.storage = Storage::symmetric_lower;
  out.col_ptr.assign(1, 0);
  for (const std::vector<Entry>& column : columns) {
    for (const Entry& e : column) {
      out.row_ind.push_back(e.row);
      out.values.push_back(e.value);
    }
    out.col_ptr.push_back(static_cast<Offset>(out.row_ind.size()));
  }
  return out;
}

// How far a matrix is from its symmetric part, relative to its largest entry.
double asymmetry(const SparseMatrix& a) {
  Eigen::SparseMatrix<double> full(a.rows, a.cols);
  std::vector<Eigen::Triplet<double>> entries;
  double largest = 0;
  for (Index j = 0; j < a.cols; ++j)
    for (Offset k = a.col_ptr[vibration_at(j)]; k < a.col_ptr[vibration_at(j) + 1]; ++k) {
      const double v = a.values[vibration_at(k)];
      entries.emplace_back(a.row_ind[vibration_at(k)], j, v);
      entries.emplace_back(j, a.row_ind[vibration_at(k)], -v);
      largest = std::max(largest, std::abs(v));
    }
  full.setFromTriplets(entries.begin(), entries.end());
  double worst = 0;
  for (Eigen::Index k = 0; k < full.nonZeros(); ++k) worst = std::max(worst, std::abs(full.valuePtr()[k]));
  return largest > 0 ? worst / largest : 0;
}

// X^T A X.
Eigen::MatrixXd projected(const SparseMatrix& a, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd ax = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  for (Eigen::Index c = 0; c < x.cols(); ++c)
    for (Index j = 0; j < a.cols; ++j)
      for (Offset k = a.col_ptr[vibration_at(j)]; k < a.col_ptr[vibration_at(j) + 1]; ++k)
        ax(a.row_ind[vibration_at(k)], c) += a.values[vibration_at(k)] * x(j, c);
  return x.transpose() * ax;
}

Mode vibration_of(std::complex<double> e, const Eigen::VectorXcd& shape) {
  const double modulus = std::abs(e);
  return {e, std::abs(e.imag()) / (2 * std::numbers::pi), modulus > 0 ? -e.real() / modulus : 0.0, real_shape(shape)};
}

// Of z'' + D z' + C z = 0, by modulus, one of each pair.
std::vector<Mode> damped(const Eigen::MatrixXd& damping, const Eigen::MatrixXd& stiffness, const Eigen::MatrixXd& x) {
  const Eigen::Index q = damping.rows();
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(2 * q, 2 * q);
  companion.topRightCorner(q, q).setIdentity();
  companion.bottomLeftCorner(q, q) = -stiffness;
  companion.bottomRightCorner(q, q) = -damping;
  const dense::ComplexSpectrum eigen = dense::general_eigen(companion);
  std::vector<Mode> modes;
  const double largest = eigen.values.cwiseAbs().maxCoeff();
  for (Eigen::Index k = 0; k < 2 * q; ++k)
    if (eigen.values[k].imag() >= -1e-14 * largest)
      modes.push_back(vibration_of(eigen.values[k], x.leftCols(q) * eigen.vectors.col(k).head(q)));
  std::sort(modes.begin(), modes.end(),
            [](const Mode& a, const Mode& b) { return std::abs(a.eigenvalue) < std::abs(b.eigenvalue); });
  return modes;
}

std::vector<Mode> undamped(const ModesResult& found, const Eigen::MatrixXd& x) {
  std::vector<Mode> modes;
  for (std::size_t i = 0; i < found.eigenvalues.size(); ++i) {
    const double l = found.eigenvalues[i];
    const std::complex<double> e = l >= 0 ? std::complex<double>(0, std::sqrt(l)) : std::sqrt(-l);
    modes.push_back(vibration_of(e, x.col(static_cast<Eigen::Index>(i)).cast<std::complex<double>>()));
  }
  return modes;
}

}  // namespace

Vibrations small_vibrations(Equations& equations, const State& state, Index count, const Options& solver) {
  constexpr double kUnsymmetric = 1e-8;
  const TangentMatrices a = tangent_matrices(equations.system(), state);
  equations.evaluate_constraints(state.t, state.q, {});
  const std::vector<Index> rows = kept_constraints(equations);
  const double velocity_forces = max_norm(a.damping.values);
  const bool plain = velocity_forces == 0 && asymmetry(a.stiffness) < kUnsymmetric;
  const Index n = a.mass.cols, free = n - static_cast<Index>(rows.size());
  ModesOptions options;
  options.count = std::min(plain ? count : 3 * count + 40, free);
  options.solver = solver;
  Vibrations out;
  if (options.count <= 0) return out;
  const SparsePattern& phi = equations.system().constraint_pattern();
  const ModesResult found =
      find_modes(bordered(a.stiffness, phi, equations.phi_q(), rows), bordered(a.mass, phi, {}, rows), options);
  if (!found.status.ok()) throw Error(found.status.code, "initial.modes: " + found.status.message);
  const Eigen::Map<const Eigen::MatrixXd> all(found.vectors.data(), found.n, found.count());
  const Eigen::MatrixXd x = all.topRows(n);
  if (plain) {
    out.modes = undamped(found, x);
    if (!found.complete) out.notice = "initial.modes: " + found.completeness;
    return out;
  }
  const Eigen::MatrixXd d = projected(a.damping, x), c = projected(a.stiffness, x);
  out.modes = damped(d, c, x);
  const Eigen::Index fewer = d.rows() < free ? std::max<Eigen::Index>(count, 3 * d.rows() / 4) : d.rows();
  const std::vector<Mode> less = damped(d.topLeftCorner(fewer, fewer), c.topLeftCorner(fewer, fewer), x);
  double change = 0;
  const std::size_t shown = std::min({vibration_at(count), out.modes.size(), less.size()});
  for (std::size_t i = 0; i < shown; ++i)
    change = std::max(change, std::abs(std::abs(less[i].eigenvalue) - std::abs(out.modes[i].eigenvalue)) /
                                  std::max(std::abs(out.modes[i].eigenvalue), 1e-300));
  out.modes.resize(std::min(vibration_at(count), out.modes.size()));
  if (fewer < d.rows())
    out.notice = fmt::format(
        "initial.modes: damping is taken in the space of {} undamped modes; with {} of them eigenvalues differ by up "
        "to "
        "{:.1e}",
        d.rows(), fewer, change);
  return out;
}

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
    if (dropped.empty() || dropped[vibration_at(i)] == 0) rows.push_back(i);
  const SparsePattern& phi = equations.system().constraint_pattern();
  const std::vector<double> zeros(equations.phi_q().size(), 0.0);
  return {bordered(a.stiffness, phi, equations.phi_q(), rows), bordered(a.mass, phi, zeros, rows)};
}

// X^T A X of a lower triangle whose duplicates are summed.
Eigen::MatrixXd lower_projected(const SparseMatrix& a, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd ax = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  for (Index j = 0; j < a.cols; ++j)
    for (Offset k = a.col_ptr[vibration_at(j)]; k < a.col_ptr[vibration_at(j) + 1]; ++k) {
      const Index i = a.row_ind[vibration_at(k)];
      ax.row(i) += a.values[vibration_at(k)] * x.row(j);
      if (i != j) ax.row(j) += a.values[vibration_at(k)] * x.row(i);
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
