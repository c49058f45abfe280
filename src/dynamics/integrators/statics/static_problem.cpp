#include "dynamics/integrators/statics/static_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dynamics/dae/vectors.hpp"

namespace espalier::dynamics {

StaticProblem::StaticProblem(Equations& equations, const State& start, double load)
    : equations_(equations),
      start_(start),
      load_(load),
      n_(start.v.size()),
      m_(start.lambda.size()),
      size_(n_),
      f0_(n_, 0.0),
      phi0_(m_, 0.0) {
  std::fill(start_.lambda.begin(), start_.lambda.end(), 0.0);
  System& system = equations.system();
  system.magnitude(start.q, size_);
  extent_ = max_norm(size_) > 0 ? max_norm(size_) : 1.0;
  const double far = max_norm(start.q);
  mass_ = diagonal_of({1, 0, 0});
  for_each_entry(pool(), n_, [&](std::size_t i) { mass_[i] = mass_[i] > 0 ? mass_[i] : 1; });
  size_norm_ = std::sqrt(sum_of(
      pool(), n_, [&](std::size_t i) { return mass_[i] * (size_[i] > 0 ? size_[i] * size_[i] : extent_ * extent_); }));
  for_each_entry(pool(), n_, [&](std::size_t i) { size_[i] = std::max(size_[i], far); });
  set_typical();
  StaticPoint x = this->start();
  if (!evaluate(x)) return;  // the caller finds that too
  f0_ = x.motion;
  phi0_ = x.phi;
  reference_ = std::max(force_norm(f0_), force_norm(load_rate(x)));
}

// The diagonal of W at the start. W is made where K takes it from: it is large.
std::vector<double> StaticProblem::diagonal_of(const TangentWeights& weights) {
  System& system = equations_.system();
  equations_.update_pattern();
  const SparsePattern& p = system.tangent_pattern();
  const Span values = equations_.kkt().w_values();
  system.tangent(start_.view(), weights, values);
  std::vector<double> diagonal(n_);
  for_each_entry(pool(), n_, [&](std::size_t i) {
    diagonal[i] = values[static_cast<std::size_t>(find_entry(p, static_cast<Index>(i), static_cast<Index>(i)))];
  });
  return diagonal;
}

StaticProblem::~StaticProblem() { equations_.kkt().set_typical({}); }

// Without inertia a rigid body has no diagonal in W, or one of rounding (the curvature of its joints). Scaled by that,
// its part would be all that is left of the joint's rows, and K singular. So its diagonal counts as the mass times the
// usual ratio of stiffness to mass.
void StaticProblem::set_typical() {
  constexpr double kSoft = 1e-6;
  std::vector<double> typical = diagonal_of({0, 0, 1});
  double largest = 0;
  for (std::size_t i = 0; i < n_; ++i) {
    typical[i] = std::abs(typical[i]) / mass_[i];
    largest = std::max(largest, typical[i]);
  }
  if (!(largest > 0) || !std::isfinite(largest)) return;
  double sum = 0, count = 0;
  for (const double ratio : typical)
    if (ratio > kSoft * largest) sum += std::log(ratio), ++count;
  for (std::size_t i = 0; i < n_; ++i) typical[i] = mass_[i] * std::exp(sum / count);
  equations_.kkt().set_typical(std::move(typical));
}

StaticPoint StaticProblem::start() const {
  return {start_, 0, std::vector<double>(n_, 0.0), std::vector<double>(m_, 0.0)};
}

bool StaticProblem::evaluate(StaticPoint& x) {
  System& system = equations_.system();
  system.set_load_factor(load(x));
  try {
    equations_.evaluate_constraints(x.state.t, x.state.q, {});
    equations_.motion(x.state.view(), x.motion);
  } catch (const Error& error) {
    if (error.status().code != StatusCode::singular) throw;
    why_ = error.status();
    return false;
  }
  const double rest = 1 - x.share;
  for_each_entry(pool(), n_, [&](std::size_t i) { x.motion[i] -= rest * f0_[i]; });
  for (std::size_t i = 0; i < m_; ++i) x.phi[i] = equations_.phi()[i] - rest * phi0_[i];
  return std::isfinite(residual(x)) &&
         std::isfinite(max_norm(x.phi));  // a square that overflows is balanced by nothing
}

StaticPoint StaticProblem::moved(const StaticPoint& x, const StaticIncrement& d, double factor) const {
  StaticPoint y = x;
  std::vector<double> dq(n_);
  for_each_entry(pool(), n_, [&](std::size_t i) { dq[i] = factor * d.x[i]; });
  equations_.system().retract(x.state.q, dq, y.state.q);
  for (std::size_t i = 0; i < m_; ++i) y.state.lambda[i] += factor * d.x[n_ + i];
  y.share += factor * d.share;
  return y;
}

StaticIncrement StaticProblem::between(const StaticPoint& a, const StaticPoint& b) const {
  StaticIncrement d{std::vector<double>(n_ + m_, 0.0), b.share - a.share};
  equations_.system().local(a.state.q, b.state.q, Span(d.x).first(n_));
  return d;
}

bool StaticProblem::factorize(const StaticPoint& x, double stiffening) {
  if (watch_) watch_(x);
  stiffening_ = stiffening;
  try {
    equations_.factorize(x.state.view(), {stiffening, 0, 1});
  } catch (const Error& error) {
    if (error.status().code != StatusCode::singular) throw;
    why_ = error.status();
    return false;
  }
  return true;
}

// z = K^-1 M z_old turns to the softest motion; its stiffness z^T W z = z^T M z_old counts beside the sum of its terms.
bool StaticProblem::indifferent() {
  constexpr double kRoundingOfStiffness = 1000 * std::numeric_limits<double>::epsilon();
  constexpr int kIterations = 4;
  StaticIncrement z{std::vector<double>(n_ + m_, 0.0), 0};
  for (std::size_t i = 0; i < n_; ++i) z.x[i] = 1 + 0.5 * std::sin(static_cast<double>(i * i % 1009));
  std::vector<double> old;
  for (int k = 0; k < kIterations; ++k) {
    const double length = norm(z);
    if (!std::isfinite(length) || length == 0) return false;
    for (std::size_t i = 0; i < n_; ++i) z.x[i] *= mass_[i] / length;
    std::fill(z.x.begin() + static_cast<std::ptrdiff_t>(n_), z.x.end(), 0.0);
    old = z.x;
    equations_.solve(z.x);
  }
  const double stiffness = sum_of(pool(), n_, [&](std::size_t i) { return z.x[i] * old[i]; });
  const SparsePattern& p = equations_.kkt().w_pattern();
  const ConstSpan values = equations_.kkt().w_of_factor();
  const double terms = sum_of(pool(), n_, [&](std::size_t c) {
    double sum = 0;
    for (auto k = static_cast<std::size_t>(p.ptr[c]); k < static_cast<std::size_t>(p.ptr[c + 1]); ++k)
      sum += std::abs(values[k] * z.x[c] * z.x[static_cast<std::size_t>(p.ind[k])]);
    return sum;
  });
  if (!(std::abs(stiffness) <= kRoundingOfStiffness * terms)) return false;
  const double length = norm(z);
  for (double& value : z.x) value /= length;
  softest_ = std::move(z);
  return true;
}

StaticIncrement StaticProblem::correction(const StaticPoint& x) {
  StaticIncrement d{std::vector<double>(n_ + m_), 0};
  for_each_entry(pool(), n_, [&](std::size_t i) { d.x[i] = -x.motion[i]; });
  for (std::size_t i = 0; i < m_; ++i) d.x[n_ + i] = -x.phi[i];
  equations_.solve(d.x);
  return d;
}

/// Derivative of motion with respect to the share. It is linear in the load factor: the difference of two of them.
std::vector<double> StaticProblem::load_rate(const StaticPoint& x) {
  std::vector<double> unloaded(n_), rate(n_);
  System& system = equations_.system();
  system.set_load_factor(0);
  equations_.motion(x.state.view(), unloaded);
  system.set_load_factor(load_);
  equations_.motion(x.state.view(), rate);
  system.set_load_factor(load(x));
  for_each_entry(pool(), n_, [&](std::size_t i) { rate[i] += f0_[i] - unloaded[i]; });
  return rate;
}

StaticIncrement StaticProblem::rate(const StaticPoint& x) {
  StaticIncrement d{load_rate(x), 1};
  for_each_entry(pool(), n_, [&](std::size_t i) { d.x[i] = -d.x[i]; });
  for (const double gap : phi0_) d.x.push_back(-gap);
  equations_.solve(d.x);
  return d;
}

double StaticProblem::force_norm(ConstSpan f) const {
  return std::sqrt(sum_of(pool(), n_, [&](std::size_t i) { return f[i] * f[i] / mass_[i]; }));
}

// Reactions count as forces: a body that is pulled into its joints has no others.
double StaticProblem::reactions(const StaticPoint& x) const {
  std::vector<double> reaction(n_, 0.0);
  if (m_ > 0) add_transposed(equations_.system().constraint_pattern(), equations_.phi_q(), x.state.lambda, reaction);
  return force_norm(reaction);
}

double StaticProblem::dot(const StaticIncrement& a, const StaticIncrement& b) const {
  return sum_of(pool(), n_, [&](std::size_t i) { return mass_[i] * a.x[i] * b.x[i]; });
}

double StaticProblem::norm(const StaticIncrement& d) const { return std::sqrt(dot(d, d)); }

double StaticProblem::residual(const StaticPoint& x) const { return force_norm(x.motion); }

void StaticProblem::settle(StaticPoint& x) {
  if (!evaluate(x)) return;
  reference_ = std::max({reference_, force_norm(load_rate(x)), reactions(x)});
  equations_.system().accept(x.state.view());
}

// For a point that is far off, the reactions are no measure: they may exceed all that was met so far by ten times.
bool StaticProblem::balanced(const StaticPoint& x, double tolerance) const {
  constexpr double kGrowth = 10;
  const double reached = reactions(x);
  const double forces = reference_ > 0 ? std::max(reference_, std::min(reached, kGrowth * reference_)) : reached;
  return std::isfinite(forces) && residual(x) <= tolerance * forces && max_norm(x.phi) <= tolerance * extent_;
}

StaticProblem::Rounding StaticProblem::rounding(const State& state) const {
  constexpr double kRoundingOfSums = 16 * std::numeric_limits<double>::epsilon();
  Rounding sums{std::vector<double>(n_, 0.0), std::vector<double>(m_, 0.0)};
  KktSolver& kkt = equations_.kkt();
  std::vector<double> rounding_of_size(n_);
  for_each_entry(pool(), n_, [&](std::size_t i) { rounding_of_size[i] = kRoundingOfSums * size_[i]; });
  kkt.sum_rows_of_w(rounding_of_size, sums.motion);
  const SparsePattern& p = kkt.phi_q_pattern();
  for (std::size_t c = 0; c < m_; ++c)
    for (auto k = static_cast<std::size_t>(p.ptr[c]); k < static_cast<std::size_t>(p.ptr[c + 1]); ++k) {
      const double value = kRoundingOfSums * std::abs(kkt.phi_q_values()[k]);
      const auto column = static_cast<std::size_t>(p.ind[k]);
      sums.motion[column] += value * std::abs(state.lambda[c]);
      sums.phi[c] += value * size_[column];
    }
  return sums;
}

// Terms of W that stand for pseudo-time are none of the forces, and what is out of balance by a part that can be seen
// is no rounding, however large the terms; unless the loads themselves are (a joint that pulls a body without strain).
bool StaticProblem::may_be_rounding(const StaticPoint& x) const {
  constexpr double kVisible = 1e-2;
  const bool visible = residual(x) > kVisible * std::max(reference_, reactions(x));
  if (visible && reference_ > force_norm(rounding(x.state).motion)) return false;
  if (stiffening_ == 0) return true;
  const SparsePattern& p = equations_.kkt().w_pattern();
  const ConstSpan values = equations_.kkt().w_of_factor();
  double damped = 0, all = 0;
  for (std::size_t i = 0; i < n_; ++i) {
    const auto entry = static_cast<std::size_t>(find_entry(p, static_cast<Index>(i), static_cast<Index>(i)));
    damped += stiffening_ * mass_[i];
    all += std::abs(values[entry]);
  }
  return damped <= 0.5 * all;
}

bool StaticProblem::at_rounding(const StaticPoint& x) const {
  if (!may_be_rounding(x)) return false;
  const auto below = [](ConstSpan values, ConstSpan bounds) {
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!(std::abs(values[i]) <= bounds[i])) return false;
    return true;
  };
  const Rounding bounds = rounding(x.state);
  return below(x.motion, bounds.motion) && below(x.phi, bounds.phi);
}

bool StaticProblem::near_rounding(const StaticPoint& x) const {
  if (!may_be_rounding(x)) return false;
  const Rounding bounds = rounding(x.state);
  for (std::size_t i = 0; i < m_; ++i)
    if (!(std::abs(x.phi[i]) <= bounds.phi[i])) return false;
  return force_norm(x.motion) <= force_norm(bounds.motion);
}

bool StaticProblem::forget_rounding() {
  const Rounding bounds = rounding(start_);
  bool forgotten = false;
  const auto forget = [&](std::vector<double>& values, ConstSpan limits) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (values[i] == 0 || std::abs(values[i]) > limits[i]) continue;
      values[i] = 0;
      forgotten = true;
    }
  };
  forget(f0_, bounds.motion);
  forget(phi0_, bounds.phi);
  StaticPoint x = start();
  if (forgotten) reference_ = evaluate(x) ? std::max(force_norm(f0_), force_norm(load_rate(x))) : 0;
  return forgotten;
}

std::string StaticProblem::worst(const StaticPoint& x) const {
  std::size_t at = 0;
  const auto value = [&](std::size_t i) { return std::abs(x.motion[i]) / std::sqrt(mass_[i]); };
  for (std::size_t i = 0; i < n_; ++i)
    if (!(value(i) <= value(at))) at = i;
  std::size_t row = 0;
  for (std::size_t i = 0; i < m_; ++i)
    if (!(std::abs(x.phi[i]) <= std::abs(x.phi[row]))) row = i;
  const bool joint = m_ > 0 && !(std::abs(x.phi[row]) <= 1e-6 * extent_);
  return joint ? equations_.system().constraint_name(static_cast<Index>(row))
               : equations_.system().coordinate_name(static_cast<Index>(at));
}

}  // namespace espalier::dynamics
