#include "solver/condition.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace espalier::solver {

double estimate_inverse_norm(Index n, const InverseProduct& solve) {
  constexpr int kMostSteps = 5;
  const auto size = static_cast<std::size_t>(n);
  std::vector<double> x(size, 1.0 / n);
  std::vector<double> y(size);
  std::vector<double> sign(size, 0);
  std::vector<double> z(size);
  const auto norm_one = [](const std::vector<double>& v) {
    return std::accumulate(v.begin(), v.end(), 0.0, [](double s, double e) { return s + std::abs(e); });
  };
  double estimate = 0;
  for (int step = 0; step < kMostSteps; ++step) {
    solve(x.data(), y.data(), false);
    const double now = norm_one(y);
    if (!(now > estimate) && step > 0) break;
    estimate = now;
    bool changed = false;
    for (std::size_t i = 0; i < size; ++i) {
      const double s = std::copysign(1.0, y[i]);
      changed = changed || s != sign[i];
      sign[i] = s;
    }
    if (!changed) break;
    solve(sign.data(), z.data(), true);
    const auto largest =
        std::max_element(z.begin(), z.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
    if (step > 0 && std::abs(*largest) <= std::inner_product(z.begin(), z.end(), x.begin(), 0.0)) break;
    std::fill(x.begin(), x.end(), 0.0);
    x[static_cast<std::size_t>(largest - z.begin())] = 1;
  }
  // Higham's alternating vector guards against cancellation.
  for (std::size_t i = 0; i < size; ++i)
    x[i] =
        (i % 2 == 0 ? 1.0 : -1.0) * (1.0 + static_cast<double>(i) / std::max<double>(1.0, static_cast<double>(n) - 1));
  solve(x.data(), y.data(), false);
  return std::max(estimate, 2 * norm_one(y) / (3.0 * n));
}

}  // namespace espalier::solver
