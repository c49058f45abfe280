#include "dynamics/dae/function_system.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/at.hpp"

namespace espalier::dynamics {
namespace {

// Central differences lose a third of the digits: step eps^(1/3) of the size of the variable.
double difference_step(double x) { return 6e-6 * std::max(1.0, std::abs(x)); }

// Differences of the constraints: six points, formulas of order 6 with those of order 4 beside them. The step starts
// with kLongestStep of the coordinate (or of 1) and is divided by four until both agree to kAgreement; those of order 6
// are then good to about 1e-13 (truncation (s/L)^6/140 where (s/L)^4/30 is kAgreement, rounding 2 eps / s). kNoise:
// rounding of the constraints themselves, which no step removes.
constexpr double kLongestStep = 1e-2, kAgreement = 1e-9, kNoise = 1e-14;
constexpr std::array<double, 6> kPlaces = {1, -1, 2, -2, 3, -3};
using Samples = std::array<std::vector<double>, 6>;

/// A derivative by the formulas of order 6 and 4 from the same points.
struct Slopes {
  double sixth, fourth;
};
Slopes slopes(const Samples& f, std::size_t i, double step) {
  const double a = f[0][i] - f[1][i], b = f[2][i] - f[3][i], c = f[4][i] - f[5][i];
  return {(45 * a - 9 * b + c) / (60 * step), (8 * a - b) / (12 * step)};
}
Slopes curvatures(const Samples& f, double middle, std::size_t i, double step) {
  const double a = f[0][i] - 2 * middle + f[1][i], b = f[2][i] - 2 * middle + f[3][i],
               c = f[4][i] - 2 * middle + f[5][i];
  return {(270 * a - 27 * b + 2 * c) / (180 * step * step), (16 * a - b) / (12 * step * step)};
}

// The larger size; infinite once x is not a number.
double larger(double so_far, double x) {
  return std::isnan(x) ? std::numeric_limits<double>::infinity() : std::max(so_far, std::abs(x));
}

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
  constexpr Offset kMostByDefault = Offset{1} << 30;
  if (entries.empty() && static_cast<Offset>(rows) * cols > kMostByDefault)
    throw std::invalid_argument(
        fmt::format("{}: all entries of a {} x {} matrix are too many; give those that may be other "
                    "than zero",
                    name, rows, cols));
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
  std::vector<std::vector<Index>> result(at(p.cols));
  for (std::size_t line = 0; line + 1 < p.ptr.size(); ++line)
    for (Offset k = p.ptr[line]; k < p.ptr[line + 1]; ++k) {
      const Index other = p.ind[at(k)];
      if (by_columns)
        result[line].push_back(other);
      else
        result[at(other)].push_back(static_cast<Index>(line));
    }
  return result;
}

/// y += A x (or A^T x where `transposed`) with the values of a pattern by lines.
void multiply_lines(const SparsePattern& p, ConstSpan values, ConstSpan x, bool transposed, Span y) {
  for (std::size_t line = 0; line + 1 < p.ptr.size(); ++line)
    for (auto k = at(p.ptr[line]); k < at(p.ptr[line + 1]); ++k) {
      const auto other = at(p.ind[k]);
      if (transposed)
        y[other] += values[k] * x[line];
      else
        y[line] += values[k] * x[other];
    }
}

}  // namespace

std::vector<std::vector<Index>> independent_columns(const std::vector<std::vector<Index>>& lines, Index rows) {
  std::vector<std::vector<Index>> groups;
  std::vector<std::vector<std::size_t>> used(at(rows));  // groups that have an entry in a row
  std::vector<std::size_t> taken;                        // by group: the last column that met it
  for (std::size_t column = 0; column < lines.size(); ++column) {
    if (lines[column].empty()) continue;
    for (const Index row : lines[column])
      for (const std::size_t group : used[at(row)]) taken[group] = column + 1;
    const auto free = static_cast<std::size_t>(
        std::find_if(taken.begin(), taken.end(), [&](std::size_t last) { return last != column + 1; }) - taken.begin());
    if (free == groups.size()) {
      groups.emplace_back();
      taken.push_back(0);
    }
    groups[free].push_back(static_cast<Index>(column));
    for (const Index row : lines[column]) used[at(row)].push_back(free);
  }
  return groups;
}

FunctionSystem::FunctionSystem(DaeFunctions functions) : f_(std::move(functions)) {
  if (f_.coordinates <= 0) throw std::invalid_argument("a system needs at least one coordinate");
  if (f_.constraints < 0) throw std::invalid_argument("the number of constraints is negative");
  if (!f_.residual && !(f_.mass && f_.force)) throw std::invalid_argument("give `residual`, or `mass` and `force`");
  if (f_.constraints > 0 && !f_.constraint) throw std::invalid_argument("`constraint` is missing");
  if (!f_.constraint_names.empty() && f_.constraint_names.size() != at(f_.constraints))
    throw std::invalid_argument(
        fmt::format("{} constraint names for {} constraints", f_.constraint_names.size(), f_.constraints));
  const Index n = f_.coordinates, m = f_.constraints;
  w_pattern_ = pattern_of(f_.tangent_pattern, n, n, true, "tangent_pattern");
  phi_q_pattern_ = pattern_of(f_.constraint_pattern, m, n, false, "constraint_pattern");
  if (!f_.tangent) w_groups_ = independent_columns(columns_of(w_pattern_, true), n);
  if (!f_.constraint_jacobian) phi_q_groups_ = independent_columns(columns_of(phi_q_pattern_, false), m);
  mass_.resize(at(w_pattern_.nonzeros()));
  phi_q_shifted_.resize(at(phi_q_pattern_.nonzeros()));
  steps_.assign(at(n), 0.0);
  phi_q_columns_.resize(at(n));
  for (std::size_t i = 0; i < at(m); ++i)
    for (Offset k = phi_q_pattern_.ptr[i]; k < phi_q_pattern_.ptr[i + 1]; ++k)
      phi_q_columns_[at(phi_q_pattern_.ind[at(k)])].emplace_back(i, at(k));
  shifted_.resize(at(n));
}

std::string FunctionSystem::constraint_name(Index row) const {
  const auto i = at(row);
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
  phi_q_by_differences(t, q, values);
}

void FunctionSystem::constraint_at(double t, ConstSpan q, std::vector<double>& phi) const {
  phi.assign(at(f_.constraints), 0.0);
  f_.constraint(t, q, phi);
}

// Columns whose formulas of order 6 and 4 do not agree are taken again with a quarter of the step.
void FunctionSystem::phi_q_by_differences(double t, ConstSpan q, Span values) {
  std::vector<double> moved(q.begin(), q.end());
  const auto size_of = [&](std::size_t j) { return std::max(1.0, std::abs(q[j])); };
  for (const std::vector<Index>& group : phi_q_groups_) {
    for (std::vector<Index> open = group, again; !open.empty(); open.swap(again), again.clear()) {
      for (std::size_t k = 0; k < 6; ++k) {
        for (const Index column : open) {
          const auto j = at(column);
          if (steps_[j] == 0) steps_[j] = kLongestStep * size_of(j);
          moved[j] = q[j] + kPlaces[k] * steps_[j];
        }
        constraint_at(t, moved, samples_[k]);
        for (const Index column : open) moved[at(column)] = q[at(column)];
      }
      for (const Index column : open) {
        const auto j = at(column);
        double apart = 0, size = 0;
        for (const auto& [row, k] : phi_q_columns_[j]) {
          const Slopes d = slopes(samples_, row, steps_[j]);
          values[k] = d.sixth;
          apart = larger(apart, d.sixth - d.fourth);
          size = std::max(size, std::abs(d.sixth));
        }
        const double shortest = difference_step(q[j]);
        if (apart <= kAgreement * size + kNoise * size_of(j) / steps_[j] || steps_[j] <= shortest) continue;
        steps_[j] = std::max(steps_[j] / 4, shortest);
        again.push_back(column);
      }
    }
  }
}

// gamma = -d/dt (Phi_q v + Phi_t) along q' = v at fixed v, by differences in time: of Phi_q v + Phi_t where Phi_q is
// given, else twice of Phi, since the expression is also -d^2/dt^2 Phi(t, q + t v).
void FunctionSystem::gamma_by_differences(double t, ConstSpan q, ConstSpan v, Span gamma) {
  const std::size_t n = q.size(), m = gamma.size();
  const bool first = static_cast<bool>(f_.constraint_jacobian);
  double speed = 1, size = 1;
  for (const double x : v) speed = std::max(speed, std::abs(x));
  for (const double x : q) size = std::max(size, std::abs(x));
  const auto sample = [&](double shift, std::vector<double>& out) {
    for (std::size_t i = 0; i < n; ++i) shifted_[i] = q[i] + shift * v[i];
    if (!first) return constraint_at(t + shift, shifted_, out);
    phi_q(t + shift, shifted_, phi_q_shifted_);
    out.assign(m, 0.0);
    if (f_.constraint_rate) f_.constraint_rate(t + shift, shifted_, out);
    multiply_lines(phi_q_pattern_, phi_q_shifted_, v, false, out);
  };
  std::vector<double> middle;
  if (!first) sample(0, middle);
  for (double step = kLongestStep * size / speed;; step /= 4) {
    for (std::size_t k = 0; k < 6; ++k) sample(kPlaces[k] * step, samples_[k]);
    double apart = 0, largest = 0;
    for (std::size_t i = 0; i < m; ++i) {
      const Slopes d = first ? slopes(samples_, i, step) : curvatures(samples_, middle[i], i, step);
      gamma[i] = -d.sixth;
      apart = larger(apart, d.sixth - d.fourth);
      largest = std::max(largest, std::abs(d.sixth));
    }
    const double noise = kNoise * size / (first ? step / speed : step * step);
    if (apart <= kAgreement * largest + noise || step * speed <= difference_step(size)) return;
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
          const double from = x0[at(j)];
          x[at(j)] = from + sign * difference_step(from);
        }
      };
      move(1);
      full_residual(moved, plus);
      move(-1);
      full_residual(moved, minus);
      move(0);
      for (const Index j : group) {
        const auto column = at(j);
        const double scale = weight / (2 * difference_step(x0[column]));
        for (auto k = at(w_pattern_.ptr[column]); k < at(w_pattern_.ptr[column + 1]); ++k) {
          const auto i = at(w_pattern_.ind[k]);
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
