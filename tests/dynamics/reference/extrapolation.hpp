// Reference solutions of ordinary differential equations in extended precision.
#pragma once

#include <array>
#include <cstddef>
#include <utility>

namespace espalier::dynamics {

/// One step of y' = rate(y): Gragg's midpoint rule with 2, 4 ... 12 substeps and Aitken-Neville extrapolation in
/// (H/n)^2, order 12 (Hairer, Norsett, Wanner I, II.9).
template <std::size_t N, class Rate>
[[nodiscard]] std::array<long double, N> extrapolation_step(Rate&& rate, const std::array<long double, N>& y,
                                                            long double length) {
  using Values = std::array<long double, N>;
  constexpr std::size_t kColumns = 6;
  const auto sum = [](const Values& a, long double s, const Values& b) {
    Values out;
    for (std::size_t i = 0; i < N; ++i) out[i] = a[i] + s * b[i];
    return out;
  };
  std::array<Values, kColumns> row{}, previous{};  // of the tableau
  const Values first = rate(y);
  for (std::size_t k = 0; k < kColumns; ++k) {
    const std::size_t n = 2 * (k + 1);
    const long double h = length / static_cast<long double>(n);
    Values before = y, now = sum(y, h, first);
    for (std::size_t i = 1; i < n; ++i) {
      const Values next = sum(before, 2 * h, rate(now));
      before = now;
      now = next;
    }
    const Values closing = sum(before, h, rate(now));
    for (std::size_t i = 0; i < N; ++i) row[0][i] = (now[i] + closing[i]) / 2;
    for (std::size_t j = 1; j <= k; ++j) {
      const long double ratio = static_cast<long double>(k + 1) / static_cast<long double>(k + 1 - j);
      for (std::size_t i = 0; i < N; ++i) {
        row[j][i] = row[j - 1][i] + (row[j - 1][i] - previous[j - 1][i]) / (ratio * ratio - 1);
      }
    }
    std::swap(row, previous);
  }
  return previous[kColumns - 1];
}

}  // namespace espalier::dynamics
