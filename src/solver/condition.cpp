#include "solver/condition.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <vector>

namespace espalier::solver {

namespace {

double sign_of(double x) { return std::copysign(1.0, x); }
std::complex<double> sign_of(std::complex<double> x) {
  const double size = std::abs(x);
  return size > 0 ? x / size : 1;
}
double inner(const std::vector<double>& z, const std::vector<double>& x) {
  return std::inner_product(z.begin(), z.end(), x.begin(), 0.0);
}
double inner(const std::vector<std::complex<double>>& z, const std::vector<std::complex<double>>& x) {
  double sum = 0;
  for (std::size_t i = 0; i < z.size(); ++i) sum += std::real(std::conj(z[i]) * x[i]);
  return sum;
}

}  // namespace

template <class Value>
double estimate_inverse_norm(Index n, const InverseProduct<Value>& solve) {
  constexpr int kMostSteps = 5;
  const auto size = static_cast<std::size_t>(n);
  std::vector<Value> x(size, Value(1.0 / n));
  std::vector<Value> y(size);
  std::vector<Value> sign(size, Value(0));
  std::vector<Value> z(size);
  const auto norm_one = [](const std::vector<Value>& v) {
    return std::accumulate(v.begin(), v.end(), 0.0, [](double s, Value e) { return s + std::abs(e); });
  };
  double estimate = 0;
  for (int step = 0; step < kMostSteps; ++step) {
    solve(x.data(), y.data(), false);
    const double now = norm_one(y);
    if (!(now > estimate) && step > 0) break;
    estimate = now;
    bool changed = false;
    for (std::size_t i = 0; i < size; ++i) {
      const Value s = sign_of(y[i]);
      changed = changed || s != sign[i];
      sign[i] = s;
    }
    if (!changed) break;
    solve(sign.data(), z.data(), true);
    const auto largest =
        std::max_element(z.begin(), z.end(), [](Value a, Value b) { return std::abs(a) < std::abs(b); });
    if (step > 0 && std::abs(*largest) <= inner(z, x)) break;
    std::fill(x.begin(), x.end(), Value(0));
    x[static_cast<std::size_t>(largest - z.begin())] = 1;
  }
  // Higham's alternating vector guards against cancellation.
  for (std::size_t i = 0; i < size; ++i)
    x[i] =
        (i % 2 == 0 ? 1.0 : -1.0) * (1.0 + static_cast<double>(i) / std::max<double>(1.0, static_cast<double>(n) - 1));
  solve(x.data(), y.data(), false);
  return std::max(estimate, 2 * norm_one(y) / (3.0 * n));
}

template double estimate_inverse_norm(Index, const InverseProduct<double>&);
template double estimate_inverse_norm(Index, const InverseProduct<std::complex<double>>&);

}  // namespace espalier::solver
