#include "dynamics/dae/function_system.hpp"

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

}  // namespace

FunctionSystem::FunctionSystem(SystemFunctions functions) : f_(std::move(functions)) {
  if (f_.velocity <= 0) throw std::invalid_argument("a system needs at least one coordinate");
  if (!f_.residual && !(f_.mass && f_.force)) throw std::invalid_argument("give `residual`, or `mass` and `force`");
  if (f_.constraints > 0 && !f_.constraint) throw std::invalid_argument("`constraint` is missing");
  const auto n = static_cast<std::size_t>(f_.velocity), m = static_cast<std::size_t>(f_.constraints);
  w_pattern_ = dense_pattern(f_.velocity, f_.velocity, true);
  phi_q_pattern_ = dense_pattern(f_.constraints, f_.velocity, false);
  mass_.resize(n * n);
  w_rows_.resize(n * n);
  phi_q_.resize(m * n);
  phi_q_shifted_.resize(m * n);
  plus_.resize(std::max(n, m));
  minus_.resize(std::max(n, m));
  shifted_.resize(n);
}

std::string FunctionSystem::constraint_name(Index row) const {
  const auto i = static_cast<std::size_t>(row);
  return i < f_.constraint_names.size() ? "\"" + f_.constraint_names[i] + "\"" : System::constraint_name(row);
}

void FunctionSystem::residual(const StateView& s, Span f) {
  std::fill(f.begin(), f.end(), 0.0);
  if (f_.residual) {
    f_.residual(s, f);
    return;
  }
  const std::size_t n = f.size();
  std::fill(mass_.begin(), mass_.end(), 0.0);
  f_.mass(s.q, {mass_.data(), f_.velocity, f_.velocity});
  f_.force(s.t, s.q, s.v, f);
  for (std::size_t i = 0; i < n; ++i) {
    double sum = -f[i];
    for (std::size_t j = 0; j < n; ++j) sum += mass_[i * n + j] * s.a[j];
    f[i] = sum;
  }
}

void FunctionSystem::phi_q(double t, ConstSpan q, std::vector<double>& values) {
  std::fill(values.begin(), values.end(), 0.0);
  if (f_.constraint_jacobian) {
    f_.constraint_jacobian(t, q, {values.data(), f_.constraints, f_.velocity});
    return;
  }
  const std::size_t n = q.size(), m = values.size() / n;
  std::vector<double> moved(q.begin(), q.end());
  for (std::size_t j = 0; j < n; ++j) {
    const double step = difference_step(q[j]);
    moved[j] = q[j] + step;
    f_.constraint(t, moved, {plus_.data(), m});
    moved[j] = q[j] - step;
    f_.constraint(t, moved, {minus_.data(), m});
    moved[j] = q[j];
    for (std::size_t i = 0; i < m; ++i) values[i * n + j] = (plus_[i] - minus_[i]) / (2 * step);
  }
}

// gamma = -d/dt (Phi_q v + Phi_t) along q' = v at fixed v, by central differences in time.
void FunctionSystem::gamma_by_differences(double t, ConstSpan q, ConstSpan v, Span gamma) {
  const std::size_t n = q.size(), m = gamma.size();
  double speed = 1;
  for (const double x : v) speed = std::max(speed, std::abs(x));
  const double step = 6e-6 / speed;
  std::fill(gamma.begin(), gamma.end(), 0.0);
  for (const double sign : {1.0, -1.0}) {
    for (std::size_t i = 0; i < n; ++i) shifted_[i] = q[i] + sign * step * v[i];
    phi_q(t + sign * step, shifted_, phi_q_shifted_);
    std::fill_n(minus_.begin(), m, 0.0);
    if (f_.constraint_rate) f_.constraint_rate(t + sign * step, shifted_, {minus_.data(), m});
    for (std::size_t i = 0; i < m; ++i) {
      double sum = minus_[i];
      for (std::size_t j = 0; j < n; ++j) sum += phi_q_shifted_[i * n + j] * v[j];
      gamma[i] -= sign * sum / (2 * step);
    }
  }
}

void FunctionSystem::constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) {
  if (f_.constraints == 0) return;
  if (!out.phi.empty()) f_.constraint(t, q, out.phi);
  if (!out.nu.empty()) {
    std::fill(out.nu.begin(), out.nu.end(), 0.0);
    if (f_.constraint_rate) f_.constraint_rate(t, q, out.nu);
    for (double& x : out.nu) x = -x;
  }
  if (!out.gamma.empty()) {
    if (f_.constraint_gamma) {
      f_.constraint_gamma(t, q, v, out.gamma);
    } else {
      gamma_by_differences(t, q, v, out.gamma);
    }
  }
  if (!out.phi_q_values.empty()) {
    phi_q(t, q, phi_q_);
    std::copy(phi_q_.begin(), phi_q_.end(), out.phi_q_values.begin());
  }
}

Energy FunctionSystem::energy(const StateView& s) { return f_.energy ? f_.energy(s) : Energy{}; }

void FunctionSystem::full_residual(const StateView& s, std::vector<double>& f) {
  residual(s, f);
  if (f_.constraints == 0) return;
  phi_q(s.t, s.q, phi_q_shifted_);
  const std::size_t n = f.size();
  for (std::size_t i = 0; i < s.lambda.size(); ++i) {
    for (std::size_t j = 0; j < n; ++j) f[j] += phi_q_shifted_[i * n + j] * s.lambda[i];
  }
}

void FunctionSystem::tangent_by_differences(const StateView& s, const TangentWeights& weights, Span w_values) {
  const std::size_t n = s.v.size();
  std::vector<double> x, plus(n), minus(n);
  const auto add = [&](double weight, ConstSpan StateView::*part) {
    if (weight == 0) return;
    StateView moved = s;
    x.assign((s.*part).begin(), (s.*part).end());
    moved.*part = x;
    for (std::size_t j = 0; j < n; ++j) {
      const double x0 = x[j], step = difference_step(x0);
      x[j] = x0 + step;
      full_residual(moved, plus);
      x[j] = x0 - step;
      full_residual(moved, minus);
      x[j] = x0;
      for (std::size_t i = 0; i < n; ++i) w_values[j * n + i] += weight * (plus[i] - minus[i]) / (2 * step);
    }
  };
  std::fill(w_values.begin(), w_values.end(), 0.0);
  add(weights.a, &StateView::a);
  add(weights.v, &StateView::v);
  add(weights.q, &StateView::q);
}

void FunctionSystem::tangent(const StateView& s, const TangentWeights& weights, Span w_values) {
  if (!f_.tangent) {
    tangent_by_differences(s, weights, w_values);
    return;
  }
  const std::size_t n = s.v.size();
  std::fill(w_rows_.begin(), w_rows_.end(), 0.0);
  f_.tangent(s, weights, {w_rows_.data(), f_.velocity, f_.velocity});
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) w_values[j * n + i] = w_rows_[i * n + j];
  }
}

}  // namespace espalier::dynamics
