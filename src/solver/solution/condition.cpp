#include "solver/solution/condition.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <vector>

#include "base/at.hpp"
#include "base/mix.hpp"

namespace espalier::solver {

namespace {

constexpr Index kColumns = 4;
constexpr Index kSmall = 64;  // unknowns: then all columns of the inverse are formed, in the time of a few
constexpr Index kTogether = 16;

double sign_of(double x) { return std::copysign(1.0, x); }
std::complex<double> sign_of(std::complex<double> x) {
  const double size = std::abs(x);
  return size > 0 ? x / size : 1;
}

// n x columns, column-major.
template <class Value>
struct Probes {
  Probes(Index the_n, Index the_columns) : n(at(the_n)), columns(at(the_columns)), values(n * columns, Value(0)) {}
  Value* column(std::size_t c) { return values.data() + c * n; }

  std::size_t n, columns;
  std::vector<Value> values;
};

// The largest |y_j|_1; NaN stays.
template <class Value>
double largest_norm(Probes<Value>& y) {
  double most = 0;
  for (std::size_t c = 0; c < y.columns; ++c) {
    const double norm =
        std::accumulate(y.column(c), y.column(c) + y.n, 0.0, [](double s, Value e) { return s + std::abs(e); });
    if (!(norm <= most)) most = norm;
  }
  return most;
}

template <class Value>
double exact_inverse_norm(Index n, const InverseProduct<Value>& solve) {
  double most = 0;
  for (Index begin = 0; begin < n; begin += kTogether) {
    const Index columns = std::min(kTogether, n - begin);
    Probes<Value> x(n, columns), y(n, columns);
    for (Index c = 0; c < columns; ++c) x.column(at(c))[begin + c] = 1;
    solve(x.values.data(), y.values.data(), columns, false);
    if (const double norm = largest_norm(y); !(norm <= most)) most = norm;
  }
  return most;
}

// Ones, and signs without pattern.
template <class Value>
Probes<Value> first_guess(Index n) {
  Probes<Value> x(n, kColumns);
  for (std::size_t c = 0; c < x.columns; ++c)
    for (std::size_t i = 0; i < x.n; ++i)
      x.column(c)[i] = (c > 0 && base::mix(c * x.n + i + 1) % 2 == 1 ? -1.0 : 1.0) / n;
  return x;
}

// The unit vectors of the rows of z with the largest entries, of those that have not been tried.
// @returns none where the best has been
template <class Value>
std::vector<std::size_t> next_units(Probes<Value>& z, std::vector<char>& tried) {
  std::vector<double> size(z.n, 0);
  for (std::size_t c = 0; c < z.columns; ++c)
    for (std::size_t i = 0; i < z.n; ++i) size[i] = std::max(size[i], std::abs(z.column(c)[i]));
  std::vector<std::size_t> order(z.n);
  std::iota(order.begin(), order.end(), 0);
  const auto larger = [&](std::size_t a, std::size_t b) { return size[a] != size[b] ? size[a] > size[b] : a < b; };
  const auto best = *std::min_element(order.begin(), order.end(), larger);
  std::vector<std::size_t> units;
  if (tried[best] != 0) return units;
  std::erase_if(order, [&](std::size_t i) { return tried[i] != 0; });
  const std::size_t count = std::min(order.size(), z.columns);
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(), larger);
  units.assign(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count));
  for (const std::size_t i : units) tried[i] = 1;
  return units;
}

}  // namespace

template <class Value>
double estimate_inverse_norm(Index n, const InverseProduct<Value>& solve) {
  constexpr int kMostSteps = 5;
  if (n <= kSmall) return exact_inverse_norm(n, solve);
  Probes<Value> x = first_guess<Value>(n), y(n, kColumns), z(n, kColumns);
  std::vector<char> tried(x.n, 0);
  double estimate = 0;
  for (int step = 0; step < kMostSteps; ++step) {
    solve(x.values.data(), y.values.data(), static_cast<Index>(x.columns), false);
    const double now = largest_norm(y);
    if (!(now > estimate) && step > 0) break;
    estimate = now;
    for (Value& v : y.values) v = sign_of(v);
    solve(y.values.data(), z.values.data(), static_cast<Index>(x.columns), true);
    const std::vector<std::size_t> units = next_units(z, tried);
    if (units.empty()) break;
    std::fill(x.values.begin(), x.values.end(), Value(0));
    for (std::size_t c = 0; c < units.size(); ++c) x.column(c)[units[c]] = 1;
  }
  // Higham's alternating vector guards against cancellation.
  Probes<Value> alternating(n, 1), image(n, 1);
  for (std::size_t i = 0; i < x.n; ++i)
    alternating.values[i] = (i % 2 == 0 ? 1.0 : -1.0) * (1.0 + static_cast<double>(i) / (static_cast<double>(n) - 1));
  solve(alternating.values.data(), image.values.data(), 1, false);
  return std::max(estimate, 2 * largest_norm(image) / (3.0 * n));
}

template double estimate_inverse_norm(Index, const InverseProduct<double>&);
template double estimate_inverse_norm(Index, const InverseProduct<std::complex<double>>&);

}  // namespace espalier::solver
