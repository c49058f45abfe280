#include "dynamics/integrators/interpolation.hpp"

namespace espalier::dynamics {

State between(const System& system, const State& a, const State& b, double t) {
  const double h = b.t - a.t, x = (t - a.t) / h;
  const std::size_t n = a.v.size();
  std::vector<double> theta(n), rate(n), at(n), slope(n);
  system.local(a.q, b.q, theta);
  system.rate_of_velocity(theta, b.v, rate);
  // theta(0) = 0, theta'(0) = v_a; theta(1) and theta'(1) as above
  for (std::size_t i = 0; i < n; ++i) {
    const double bend = 3 * theta[i] - h * (2 * a.v[i] + rate[i]), twist = h * (a.v[i] + rate[i]) - 2 * theta[i];
    at[i] = x * (h * a.v[i] + x * (bend + x * twist));
    slope[i] = a.v[i] + x * (2 * bend + 3 * x * twist) / h;
  }
  State s = a;
  s.t = t;
  system.retract(a.q, at, s.q);
  system.velocity_of_rate(at, slope, s.v);
  for (std::size_t i = 0; i < n; ++i) s.a[i] += x * (b.a[i] - a.a[i]);
  for (std::size_t i = 0; i < s.lambda.size(); ++i) s.lambda[i] += x * (b.lambda[i] - a.lambda[i]);
  return s;
}

}  // namespace espalier::dynamics
