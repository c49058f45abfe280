#include "dynamics/dae/function_system.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace espalier::dynamics {
namespace {

// Central differences lose a third of the digits: step eps^(1/3) of the size of the variable.
double difference_step(double x) { return 6e-6 * std::max(1.0, std::abs(x)); }

SparsePattern dense_pattern(Index rows, Index cols, bool by_columns) {
  SparsePattern p{rows, cols, {0}, {}};
  const Index lines = by_columns ? cols : rows, width = by_columns ? rows : cols;
  for (Index i = 0; i < lines; ++i) {
    for (Index j = 0; j < width; ++j) p.ind.push_back(j);
    p.ptr.push_back(static_cast<Offset>(p.ind.size()));
  }
  return p;
}

SparsePattern pattern_of(const std::vector<std::pair<Index, Index>>& entries, Index rows, Index cols, bool by_columns,
                         const char* name) {
  if (entries.empty()) return dense_pattern(rows, cols, by_columns);
  PatternBuilder builder(rows, cols, by_columns);
  for (const auto& [row, col] : entries) {
    if (row < 0 || row >= rows || col < 0 || col >= cols)
      throw std::invalid_argument(
          fmt::format("{}: entry ({}, {}) lies outside of the {} x {} matrix", name, row, col, rows, cols));
    builder.add(row, col);
  }
  return builder.build();
}

/// The rows of every column of a pattern.
std::vector<std::vector<Index>> columns_of(const SparsePattern& p, bool by_columns) {
  std::vector<std::vector<Index>> result(static_cast<std::size_t>(p.cols));
  for (std::size_t line = 0; line + 1 < p.ptr.size(); ++line)
    for (Offset k = p.ptr[line]; k < p.ptr[line + 1]; ++k) {
      const Index other = p.ind[static_cast<std::size_t>(k)];
      if (by_columns)
        result[line].push_back(other);
      else
        result[static_cast<std::size_t>(other)].push_back(static_cast<Index>(line));
    }
  return result;
}

/// y += A x (or A^T x where `transposed`) with the values of a pattern by lines.
void multiply_lines(const SparsePattern& p, ConstSpan values, ConstSpan x, bool transposed, Span y) {
  for (std::size_t line = 0; line + 1 < p.ptr.size(); ++line)
    for (auto k = static_cast<std::size_t>(p.ptr[line]); k < static_cast<std::size_t>(p.ptr[line + 1]); ++k) {
      const auto other = static_cast<std::size_t>(p.ind[k]);
      if (transposed)
        y[other] += values[k] * x[line];
      else
        y[line] += values[k] * x[other];
    }
}

}  // namespace

std::vector<std::vector<Index>> independent_columns(const std::vector<std::vector<Index>>& lines, Index rows) {
  std::vector<std::vector<Index>> groups;
  std::vector<std::vector<std::size_t>> used(static_cast<std::size_t>(rows));  // groups that have an entry in a row
  std::vector<std::size_t> taken;                                              // by group: the last column that met it
  for (std::size_t column = 0; column < lines.size(); ++column) {
    if (lines[column].empty()) continue;
    for (const Index row : lines[column])
      for (const std::size_t group : used[static_cast<std::size_t>(row)]) taken[group] = column + 1;
    const auto free = static_cast<std::size_t>(
        std::find_if(taken.begin(), taken.end(), [&](std::size_t last) { return last != column + 1; }) - taken.begin());
    if (free == groups.size()) {
      groups.emplace_back();
      taken.push_back(0);
    }
    groups[free].push_back(static_cast<Index>(column));
    for (const Index row : lines[column]) used[static_cast<std::size_t>(row)].push_back(free);
  }
  return groups;
}

FunctionSystem::FunctionSystem(DaeFunctions functions) : f_(std::move(functions)) {
  if (f_.coordinates <= 0) throw std::invalid_argument("a system needs at least one coordinate");
  if (f_.constraints < 0) throw std::invalid_argument("the number of constraints is negative");
  if (!f_.residual && !(f_.mass && f_.force)) throw std::invalid_argument("give `residual`, or `mass` and `force`");
  if (f_.constraints > 0 && !f_.constraint) throw std::invalid_argument("`constraint` is missing");
  if (!f_.constraint_names.empty() && f_.constraint_names.size() != static_cast<std::size_t>(f_.constraints))
    throw std::invalid_argument(
        fmt::format("{} constraint names for {} constraints", f_.constraint_names.size(), f_.constraints));
  const Index n = f_.coordinates, m = f_.constraints;
  w_pattern_ = pattern_of(f_.tangent_pattern, n, n, true, "tangent_pattern");
  phi_q_pattern_ = pattern_of(f_.constraint_pattern, m, n, false, "constraint_pattern");
  if (!f_.tangent) w_groups_ = independent_columns(columns_of(w_pattern_, true), n);
  if (!f_.constraint_jacobian) phi_q_groups_ = independent_columns(columns_of(phi_q_pattern_, false), m);
  mass_.resize(static_cast<std::size_t>(w_pattern_.nonzeros()));
  phi_q_shifted_.resize(static_cast<std::size_t>(phi_q_pattern_.nonzeros()));
  plus_.resize(static_cast<std::size_t>(std::max(n, m)));
  minus_.resize(plus_.size());
  shifted_.resize(static_cast<std::size_t>(n));
}

std::string FunctionSystem::constraint_name(Index row) const {
  const auto i = static_cast<std::size_t>(row);
  return i < f_.constraint_names.size() ? "\"" + f_.constraint_names[i] + "\"" : System::constraint_name(row);
}

MatrixEntries FunctionSystem::tangent_entries(double* values) const {
  return {values, f_.coordinates, f_.coordinates, true, w_pattern_.ptr.data(), w_pattern_.ind.data()};
}

void FunctionSystem::residual(const StateView& s, Span f) {
  std::fill(f.begin(), f.end(), 0.0);
  if (f_.residual) {
    f_.residual(s, f);
    return;
  }
  std::fill(mass_.begin(), mass_.end(), 0.0);
  f_.mass(s.q, tangent_entries(mass_.data()));
  f_.force(s.t, s.q, s.v, f);
  for (double& x : f) x = -x;
  multiply_lines(w_pattern_, mass_, s.a, true, f);  // by columns: the lines of the transposed matrix
}

void FunctionSystem::phi_q(double t, ConstSpan q, Span values) {
  std::fill(values.begin(), values.end(), 0.0);
  if (f_.constraint_jacobian) {
    f_.constraint_jacobian(
        t, q,
        {values.data(), f_.constraints, f_.coordinates, false, phi_q_pattern_.ptr.data(), phi_q_pattern_.ind.data()});
    return;
  }
  const auto m = static_cast<std::size_t>(f_.constraints);
  std::vector<double> moved(q.begin(), q.end()), steps(q.size());  // steps: 0 where not moved
  const auto evaluate = [&](double sign, const std::vector<Index>& group, std::vector<double>& phi) {
    for (const Index j : group) moved[static_cast<std::size_t>(j)] += sign * steps[static_cast<std::size_t>(j)];
    std::fill(phi.begin(), phi.end(), 0.0);
    f_.constraint(t, moved, {phi.data(), m});
    for (const Index j : group) moved[static_cast<std::size_t>(j)] = q[static_cast<std::size_t>(j)];
  };
  for (const std::vector<Index>& group : phi_q_groups_) {
    for (const Index j : group) steps[static_cast<std::size_t>(j)] = difference_step(q[static_cast<std::size_t>(j)]);
    evaluate(1, group, plus_);
    evaluate(-1, group, minus_);
    for (std::size_t i = 0; i < m; ++i)
      for (auto k = static_cast<std::size_t>(phi_q_pattern_.ptr[i]);
           k < static_cast<std::size_t>(phi_q_pattern_.ptr[i + 1]); ++k)
        if (const double step = steps[static_cast<std::size_t>(phi_q_pattern_.ind[k])]; step != 0)
          values[k] = (plus_[i] - minus_[i]) / (2 * step);
    for (const Index j : group) steps[static_cast<std::size_t>(j)] = 0;
  }
}

// gamma = -d/dt (Phi_q v + Phi_t) along q' = v at fixed v, by central differences in time.
void FunctionSystem::gamma_by_differences(double t, ConstSpan q, ConstSpan v, Span gamma) {
  const std::size_t n = q.size(), m = gamma.size();
  double speed = 1;
  for (const double x : v) speed = std::max(speed, std::abs(x));
  const double step = 6e-6 / speed;
  std::fill(gamma.begin(), gamma.end(), 0.0);
  std::vector<double> rate(m);
  for (const double sign : {1.0, -1.0}) {
    for (std::size_t i = 0; i < n; ++i) shifted_[i] = q[i] + sign * step * v[i];
    phi_q(t + sign * step, shifted_, phi_q_shifted_);
    std::fill(rate.begin(), rate.end(), 0.0);
    if (f_.constraint_rate) f_.constraint_rate(t + sign * step, shifted_, rate);
    multiply_lines(phi_q_pattern_, phi_q_shifted_, v, false, rate);
    for (std::size_t i = 0; i < m; ++i) gamma[i] -= sign * rate[i] / (2 * step);
  }
}

void FunctionSystem::constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) {
  if (f_.constraints == 0) return;
  if (!out.phi.empty()) {
    std::fill(out.phi.begin(), out.phi.end(), 0.0);
    f_.constraint(t, q, out.phi);
  }
  if (!out.nu.empty()) {
    std::fill(out.nu.begin(), out.nu.end(), 0.0);
    if (f_.constraint_rate) f_.constraint_rate(t, q, out.nu);
    for (double& x : out.nu) x = -x;
  }
  if (!out.gamma.empty()) {
    std::fill(out.gamma.begin(), out.gamma.end(), 0.0);
    if (f_.constraint_gamma) {
      f_.constraint_gamma(t, q, v, out.gamma);
    } else {
      gamma_by_differences(t, q, v, out.gamma);
    }
  }
  if (!out.phi_q_values.empty()) phi_q(t, q, out.phi_q_values);
}

Energy FunctionSystem::energy(const StateView& s) { return f_.energy ? f_.energy(s) : Energy{}; }

void FunctionSystem::full_residual(const StateView& s, Span f) {
  residual(s, f);
  if (f_.constraints == 0) return;
  phi_q(s.t, s.q, phi_q_shifted_);
  multiply_lines(phi_q_pattern_, phi_q_shifted_, s.lambda, true, f);
}

void FunctionSystem::tangent_by_differences(const StateView& s, const TangentWeights& weights, Span w_values) {
  const std::size_t n = s.v.size();
  std::vector<double> x, plus(n), minus(n);
  const auto add = [&](double weight, ConstSpan StateView::*part) {
    if (weight == 0) return;
    const ConstSpan x0 = s.*part;
    StateView moved = s;
    x.assign(x0.begin(), x0.end());
    moved.*part = x;
    for (const std::vector<Index>& group : w_groups_) {
      const auto move = [&](double sign) {
        for (const Index j : group) {
          const double from = x0[static_cast<std::size_t>(j)];
          x[static_cast<std::size_t>(j)] = from + sign * difference_step(from);
        }
      };
      move(1);
      full_residual(moved, plus);
      move(-1);
      full_residual(moved, minus);
      move(0);
      for (const Index j : group) {
        const auto column = static_cast<std::size_t>(j);
        const double scale = weight / (2 * difference_step(x0[column]));
        for (auto k = static_cast<std::size_t>(w_pattern_.ptr[column]);
             k < static_cast<std::size_t>(w_pattern_.ptr[column + 1]); ++k) {
          const auto i = static_cast<std::size_t>(w_pattern_.ind[k]);
          w_values[k] += scale * (plus[i] - minus[i]);
        }
      }
    }
  };
  add(weights.a, &StateView::a);
  add(weights.v, &StateView::v);
  add(weights.q, &StateView::q);
}

void FunctionSystem::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  std::fill(w_values.begin(), w_values.end(), 0.0);
  if (f_.tangent)
    f_.tangent(s, weights, tangent_entries(w_values.data()));
  else
    tangent_by_differences(s, weights, w_values);
}

}  // namespace espalier::dynamics
