#include "dynamics/integrators/statics/linear_statics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "dynamics/dae/products.hpp"
#include "dynamics/integrators/initial.hpp"
#include "dynamics/integrators/statics/static_problem.hpp"

namespace espalier::dynamics {
namespace {

/// K of the last factor, times vectors of n + m numbers.
class LinearMatrix {
 public:
  explicit LinearMatrix(Equations& equations) : kkt_(equations.kkt()), equations_(equations) {}

  /// r = b - K x, and scale = |b| + |K| |x|; zero in rows that are left out.
  void residual(ConstSpan b, ConstSpan x, Span r, Span scale) {
    for (std::size_t i = 0; i < b.size(); ++i) {
      r[i] = b[i];
      scale[i] = std::abs(b[i]);
    }
    const auto add = [&](std::size_t row, std::size_t column, double value) {
      const double term = value * x[column];
      r[row] -= term;
      scale[row] += std::abs(term);
    };
    const SparsePattern& w = kkt_.w_pattern();
    const ConstSpan values = kkt_.w_of_factor();
    const auto n = static_cast<std::size_t>(w.cols);
    for (std::size_t c = 0; c < n; ++c)
      for (auto k = at(w.ptr[c]); k < at(w.ptr[c + 1]); ++k) add(at(w.ind[k]), c, values[k]);
    const SparsePattern& phi = kkt_.phi_q_pattern();
    for (std::size_t row = 0; row < static_cast<std::size_t>(phi.rows); ++row)
      for (auto k = at(phi.ptr[row]); k < at(phi.ptr[row + 1]); ++k) {
        add(at(phi.ind[k]), n + row, kkt_.phi_q_values()[k]);
        if (kept(row)) add(n + row, at(phi.ind[k]), kkt_.phi_q_values()[k]);
      }
    if (const SparsePattern* p = equations_.system().multiplier_pattern(); p != nullptr)
      for (std::size_t c = 0; c < static_cast<std::size_t>(p->cols); ++c)
        for (auto k = at(p->ptr[c]); k < at(p->ptr[c + 1]); ++k) add(at(p->ind[k]), n + c, kkt_.f_lambda_values()[k]);
  }
  [[nodiscard]] bool kept(std::size_t row) const {
    return equations_.dropped().empty() || equations_.dropped()[row] == 0;
  }

 private:
  template <class Int>
  static std::size_t at(Int i) {
    return static_cast<std::size_t>(i);
  }
  KktSolver& kkt_;
  Equations& equations_;
};

/// K^-1 r over x, in the metric of the masses, with r what rounding in W may leave of W x: half a unit of each term,
/// all of one sign, and what W changes by at coordinates moved by rounding.
double effect_of_rounding(Equations& equations, const StaticProblem& problem, const State& start,
                          const std::vector<double>& dq, const std::vector<double>& hidden) {
  constexpr double kUnit = std::numeric_limits<double>::epsilon() / 2;
  System& system = equations.system();
  const std::size_t n = dq.size();
  std::vector<double> sizes = coordinate_sizes(system, start.q);
  std::uint64_t random = 88172645463325252U;  // Marsaglia's xorshift, as in harmonic/adaptive.cpp
  for (double& size : sizes) {
    random ^= random << 13;
    random ^= random >> 7;
    random ^= random << 17;
    size *= (random >> 32 & 1) != 0 ? 2 * kUnit : -2 * kUnit;
  }
  State moved = start;
  system.retract(start.q, sizes, moved.q);
  const SparsePattern& w = equations.kkt().w_pattern();
  const ConstSpan of_factor = equations.kkt().w_of_factor();
  std::vector<double> values(of_factor.size()), moduli(n), terms(n, 0.0);
  system.tangent(moved.view(), {0, 0, 1}, values);
  StaticIncrement change{std::vector<double>(n + start.lambda.size(), 0.0), 0}, answer = change;
  for (std::size_t k = 0; k < values.size(); ++k) values[k] -= of_factor[k];
  add_transposed(w, values, dq, Span(change.x).first(n));
  for (std::size_t i = 0; i < n; ++i) moduli[i] = std::abs(dq[i]);
  equations.kkt().sum_rows_of_w(moduli, terms);
  for (std::size_t i = 0; i < n; ++i)
    change.x[i] += std::copysign(kUnit * (terms[i] + (hidden.empty() ? 0 : 2 * hidden[i] * moduli[i])), dq[i]);
  std::copy(dq.begin(), dq.end(), answer.x.begin());
  equations.solve(change.x);
  const double size = problem.norm(answer);
  return size > 0 ? problem.norm(change) / size : 0;
}

/// What is left out has to follow from what is kept, to a part of the terms that it is the sum of.
void check_left_out(Equations& equations, const State& start, ConstSpan dq) {
  constexpr double kRounding = 1e-9, kContradiction = 1e-6;
  if (equations.dropped().empty()) return;
  System& system = equations.system();
  const SparsePattern& p = system.constraint_pattern();
  std::vector<double> phi(start.lambda.size()), phi_q(static_cast<std::size_t>(p.nonzeros()));
  system.constraints(start.t, start.q, {}, {phi, {}, {}, phi_q});
  const double most = max_norm(dq);
  for (std::size_t row = 0; row < equations.dropped().size(); ++row) {
    if (equations.dropped()[row] == 0) continue;
    double sum = phi[row], terms = std::abs(phi[row]), largest = 0;
    for (auto k = static_cast<std::size_t>(p.ptr[row]); k < static_cast<std::size_t>(p.ptr[row + 1]); ++k) {
      const double value = phi_q[k], x = dq[static_cast<std::size_t>(p.ind[k])];
      sum += value * x;
      terms += std::abs(value * x);
      largest = std::max(largest, std::abs(value));
    }
    if (std::abs(sum) > std::max(kContradiction * terms, kRounding * largest * most))
      throw Error(StatusCode::invalid_input,
                  fmt::format("linear statics: {} contradicts others: it is missed by {:.3g}; remove it, or correct "
                              "what one of them prescribes",
                              system.constraint_name(static_cast<Index>(row)), sum),
                  static_cast<Index>(row));
  }
}

}  // namespace

LinearStatics linear_statics(Equations& equations, const State& start, double load, const std::function<void()>& stiff,
                             const std::vector<double>& hidden) {
  constexpr int kMostRefinements = 3;
  constexpr double kGoodEnough = 4 * std::numeric_limits<double>::epsilon();
  System& system = equations.system();
  StaticProblem problem(equations, start, load);
  StaticPoint at = problem.start(), end = at;
  end.share = 1;
  if (!problem.evaluate(end) || !problem.evaluate(at))
    throw Error(StatusCode::invalid_input, fmt::format("linear statics: the forces on the given configuration are no "
                                                       "numbers ({}); elements must not be inverted, loads finite",
                                                       problem.worst(end)));
  system.set_load_factor(0);
  stiff();
  if (!problem.factorize(at))
    throw Error(StatusCode::singular,
                fmt::format("linear statics: the structure is not held: {}", problem.why().message));
  LinearMatrix k(equations);
  const std::size_t n = start.v.size(), m = start.lambda.size();
  std::vector<double> b(n + m), x, r(n + m), scale(n + m);
  for (std::size_t i = 0; i < n; ++i) b[i] = -end.motion[i];
  for (std::size_t i = 0; i < m; ++i) b[n + i] = k.kept(i) ? -end.phi[i] : 0;
  x = b;
  equations.solve(x);
  LinearStatics result;
  result.factorizations = 1;
  for (int step = 0;; ++step) {
    k.residual(b, x, r, scale);
    double error = 0;
    for (std::size_t i = 0; i < n + m; ++i)
      if (r[i] != 0 || std::isnan(r[i])) error = std::max(error, std::abs(r[i]) / scale[i]);
    const bool better = step == 0 || error < result.backward_error;
    if (better) {
      result.backward_error = error;
      result.residual = max_norm(ConstSpan(r).first(n));
      result.dq.assign(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(n));
      result.lambda.assign(x.begin() + static_cast<std::ptrdiff_t>(n), x.end());
    }
    if (!better || error <= kGoodEnough || step == kMostRefinements) break;
    equations.solve(r);
    for (std::size_t i = 0; i < n + m; ++i) x[i] += r[i];
  }
  check_left_out(equations, start, result.dq);
  result.rounding = effect_of_rounding(equations, problem, start, result.dq, hidden);
  const std::vector<double> sizes = coordinate_sizes(system, start.q);
  std::size_t most = 0;
  for (std::size_t i = 0; i < n; ++i)
    if (std::abs(result.dq[i]) / sizes[i] > std::abs(result.dq[most]) / sizes[most]) most = i;
  if (n > 0) result.softest = system.coordinate_name(static_cast<Index>(most));
  return result;
}

}  // namespace espalier::dynamics
