// The truth of step_cases.hpp.
#include <algorithm>
#include <cmath>

#include "dynamics/integrators/initial.hpp"
#include "dynamics/integrators/step_cases.hpp"

namespace espalier::dynamics {

namespace {

/// y = (theta, v) around the configuration `base`: theta' = T(theta)^-1 v, v' = a(t, base (+) theta, v).
class IndexOne {
 public:
  explicit IndexOne(System& system)
      : system_(system), equations_(system), s_(system.sizes()), n_(s_.v.size()), b_(n_ + s_.lambda.size()) {}

  /// Accelerations and multipliers of q and v: K [a; lambda] = [-F(a = 0); gamma], refined twice.
  void accelerate(State& s) {
    equations_.evaluate_constraints(s.t, s.q, s.v);
    equations_.factorize(s.view(), {1, 0, 0});
    std::fill(s.a.begin(), s.a.end(), 0.0);
    std::fill(s.lambda.begin(), s.lambda.end(), 0.0);
    const Span upper(b_.data(), n_), lower(b_.data() + n_, b_.size() - n_);
    for (int k = 0; k < 3; ++k) {
      equations_.motion(s.view(), upper);
      equations_.level(s.a, equations_.gamma(), lower);
      for (double& x : b_) x = -x;
      equations_.solve(b_);
      for (std::size_t i = 0; i < n_; ++i) s.a[i] += upper[i];
      for (std::size_t i = 0; i < lower.size(); ++i) s.lambda[i] += lower[i];
    }
  }

  void rate(const State& base, double t, const std::vector<double>& y, std::vector<double>& out) {
    s_.t = t;
    const ConstSpan theta(y.data(), n_), v(y.data() + n_, n_);
    system_.retract(base.q, theta, s_.q);
    std::copy(v.begin(), v.end(), s_.v.begin());
    accelerate(s_);
    system_.rate_of_velocity(theta, v, Span(out.data(), n_));
    std::copy(s_.a.begin(), s_.a.end(), out.begin() + static_cast<std::ptrdiff_t>(n_));
  }

  void project(State& s) { make_consistent(equations_, s); }

 private:
  System& system_;
  Equations equations_;
  State s_;
  std::size_t n_;
  std::vector<double> b_;
};

/// y + the increment of Gragg's rule with n substeps; increments keep small numbers apart from large ones.
std::vector<double> gragg(IndexOne& ode, const State& base, double length, int n) {
  const std::size_t size = 2 * base.v.size();
  const double h = length / n;
  std::vector<double> before(size, 0.0), now(size), rate(size), next(size);
  std::copy(base.v.begin(), base.v.end(), before.begin() + static_cast<std::ptrdiff_t>(base.v.size()));
  ode.rate(base, base.t, before, rate);
  for (std::size_t i = 0; i < size; ++i) now[i] = before[i] + h * rate[i];
  for (int k = 1; k < n; ++k) {
    ode.rate(base, base.t + k * h, now, rate);
    for (std::size_t i = 0; i < size; ++i) next[i] = before[i] + 2 * h * rate[i];
    before.swap(now);
    now.swap(next);
  }
  ode.rate(base, base.t + length, now, rate);
  for (std::size_t i = 0; i < size; ++i) now[i] = (now[i] + before[i] + h * rate[i]) / 2;
  return now;
}

std::vector<double> extrapolated(IndexOne& ode, const State& base, double length) {
  constexpr int kColumns = 6;
  std::vector<std::vector<double>> row;  // of the tableau: T_k,0 .. T_k,k
  for (int k = 0; k < kColumns; ++k) {
    std::vector<std::vector<double>> next{gragg(ode, base, length, 2 * (k + 1))};
    for (int j = 1; j <= k; ++j) {
      const double ratio = static_cast<double>(k + 1) / (k + 1 - j);
      std::vector<double> t = next.back();
      const std::vector<double>& above = row[static_cast<std::size_t>(j) - 1];
      for (std::size_t i = 0; i < t.size(); ++i) t[i] += (t[i] - above[i]) / (ratio * ratio - 1);
      next.push_back(std::move(t));
    }
    row = std::move(next);
  }
  return row.back();
}

double largest_difference(ConstSpan x, ConstSpan y) {
  double d = 0;
  for (std::size_t i = 0; i < x.size(); ++i) d = std::max(d, std::abs(x[i] - y[i]));
  return d;
}

double relative(ConstSpan x, ConstSpan truth) {
  const double size = max_norm(truth);
  return size > 0 ? largest_difference(x, truth) / size : max_norm(x);
}

}  // namespace

State index_one_truth(System& system, State from, double until, double length) {
  IndexOne ode(system);
  const double begin = from.t;
  const auto steps = static_cast<long>(std::ceil((until - begin) / length - 1e-9));
  const std::size_t n = from.v.size();
  for (long k = 1; k <= steps; ++k) {
    const double t = begin + (until - begin) * static_cast<double>(k) / static_cast<double>(steps);
    const std::vector<double> y = extrapolated(ode, from, t - from.t);
    system.retract(from.q, ConstSpan(y.data(), n), from.q);
    std::copy_n(y.begin() + static_cast<std::ptrdiff_t>(n), n, from.v.begin());
    from.t = t;
    ode.project(from);
  }
  ode.accelerate(from);
  return from;
}

StepErrors step_errors(const System& system, const State& s, const State& truth) {
  std::vector<double> theta(truth.v.size()), size(truth.v.size());
  system.local(truth.q, s.q, theta);
  system.magnitude(truth.q, size);
  return {max_norm(theta) / std::max(max_norm(size), 1e-300), relative(s.v, truth.v), relative(s.a, truth.a),
          relative(s.lambda, truth.lambda)};
}

}  // namespace espalier::dynamics
