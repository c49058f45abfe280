// How far the derivatives of a step are from differences.
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "base/at.hpp"
#include "dynamics/dae/products.hpp"
#include "dynamics/integrators/derivatives/step_adjoint.hpp"

namespace espalier::dynamics {
namespace {

State moved_along(const System& system, const State& now, const StateSlopes& along, double step) {
  State s = now;
  std::vector<double> dq = along.q;
  for (double& x : dq) x *= step;
  system.retract(now.q, dq, s.q);
  for (std::size_t i = 0; i < s.v.size(); ++i) {
    s.v[i] += step * along.v[i];
    s.a[i] += step * along.a[i];
  }
  for (std::size_t i = 0; i < s.lambda.size(); ++i) s.lambda[i] += step * along.lambda[i];
  return s;
}

}  // namespace

// The largest difference between the levels' derivatives along a direction and their differences, over the row's terms.
double StepAdjoint::difference_of_levels(const State& now, const StateSlopes& along, double step) {
  const SparsePattern& p = system_.constraint_pattern();
  const std::vector<double> phi_q(equations_.phi_q().begin(), equations_.phi_q().end());
  std::array<std::vector<double>, 4> velocity, acceleration;
  constexpr std::array<double, 4> kWays = {-2, -1, 1, 2};
  for (std::size_t k = 0; k < kWays.size(); ++k) {
    const State s = moved_along(system_, now, along, kWays[k] * step);
    velocity[k].resize(m_);
    acceleration[k].resize(m_);
    equations_.evaluate_constraints(s.t, s.q, s.v);
    equations_.level(s.v, equations_.nu(), velocity[k]);
    equations_.level(s.a, equations_.gamma(), acceleration[k]);
  }
  equations_.evaluate_constraints(now.t, now.q, now.v);
  double largest_v = 0, largest_a = 0, worst_v = 0, worst_a = 0;
  const auto slope = [step](const std::array<std::vector<double>, 4>& f, std::size_t i) {
    return (8 * (f[2][i] - f[1][i]) - (f[3][i] - f[0][i])) / (12 * step);
  };
  for (std::size_t i = 0; i < m_; ++i) {
    if (dropped(static_cast<Index>(i))) continue;
    double sum_v = 0, sum_a = 0, terms_v = 0, terms_a = 0;
    const auto add = [](double term, double& sum, double& terms) {
      sum += term;
      terms += std::abs(term);
    };
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) {
      const std::size_t j = at(p.ind[k]);
      add(phi_q[k] * along.v[j], sum_v, terms_v);
      add(levels_.velocity_by_q()[k] * along.q[j], sum_v, terms_v);
      add(phi_q[k] * along.a[j], sum_a, terms_a);
      add(levels_.acceleration_by_q()[k] * along.q[j], sum_a, terms_a);
      add(levels_.acceleration_by_v()[k] * along.v[j], sum_a, terms_a);
    }
    largest_v = std::max(largest_v, terms_v);
    largest_a = std::max(largest_a, terms_a);
    worst_v = std::max(worst_v, std::abs(slope(velocity, i) - sum_v));
    worst_a = std::max(worst_a, std::abs(slope(acceleration, i) - sum_a));
  }
  return std::max(largest_v > 0 ? worst_v / largest_v : 0, largest_a > 0 ? worst_a / largest_a : 0);
}

double StepAdjoint::defect(const State& now) {
  if (n_ == 0) return 0;
  constexpr double kShare = 2e-3;  // of the forces that act, which the random ones change
  std::mt19937_64 random(20);
  std::uniform_real_distribution<double> amount(-1, 1);
  std::vector<double> r(n_ + m_, 0.0), x(r.size());
  for (std::size_t i = 0; i < n_; ++i) r[i] = amount(random);
  const SolveResult solved = solver_.solve(r, x, 1);
  if (!solved.status.ok()) throw Error(solved.status.code, "adjoint: " + solved.status.message);
  StateSlopes along;
  along.a.assign(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(n_));
  along.lambda.assign(x.begin() + static_cast<std::ptrdiff_t>(n_), x.end());
  along.v = along.q = along.a;
  for (double& value : along.v) value *= hp_;
  for (double& value : along.q) value *= hp_ * hp_;
  std::vector<double> inertia(n_, 0.0), reactions(n_, 0.0), f(n_);
  dynamics::add_transposed(system_.tangent_pattern(), by_a_, now.a, inertia);
  if (m_ > 0) dynamics::add_transposed(system_.constraint_pattern(), equations_.phi_q(), now.lambda, reactions);
  const double forces = std::max(max_norm(inertia), max_norm(reactions));
  const double step = kShare * (forces > 0 ? forces : 1);
  std::vector<double> sum(n_, 0.0);
  for (const auto& [way, weight] : {std::pair{-2.0, 1.0}, {-1.0, -8.0}, {1.0, 8.0}, {2.0, -1.0}}) {
    const State s = moved_along(system_, now, along, way * step);
    equations_.evaluate_constraints(s.t, s.q, {});
    equations_.motion(s.view(), f);
    for (std::size_t i = 0; i < n_; ++i) sum[i] += weight * f[i];
  }
  equations_.evaluate_constraints(now.t, now.q, now.v);
  double worst = 0;
  for (std::size_t i = 0; i < n_; ++i) worst = std::max(worst, std::abs(sum[i] / (12 * step) - r[i]));
  return m_ > 0 ? std::max(worst, difference_of_levels(now, along, step)) : worst;
}

}  // namespace espalier::dynamics
