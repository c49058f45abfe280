/// \file
/// Systems as optimisers make them, with what is known of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace espalier::test {

/// [H B^T; B 0] with H = diag > 0 on a chain and B of full rank: m negative eigenvalues. Lower triangle by columns,
/// 1-based, a diagonal entry in each column.
struct Kkt {
  int n = 0, negative = 0;
  std::vector<int> pointers{1}, rows;
  std::vector<double> values;

  [[nodiscard]] int entries() const { return static_cast<int>(rows.size()); }
  /// A x.
  [[nodiscard]] std::vector<double> times(const std::vector<double>& x) const {
    std::vector<double> y(x.size(), 0.0);
    for (int c = 0; c < n; ++c)
      for (int k = pointers[c] - 1; k < pointers[c + 1] - 1; ++k) {
        const int r = rows[k] - 1;
        y[r] += values[k] * x[c];
        if (r != c) y[c] += values[k] * x[r];
      }
    return y;
  }
  /// The componentwise backward error of x (Oettli and Prager).
  [[nodiscard]] double backward_error(const std::vector<double>& x, const std::vector<double>& b) const {
    Kkt magnitudes = *this;
    for (double& v : magnitudes.values) v = std::abs(v);
    std::vector<double> length = x;
    for (double& v : length) v = std::abs(v);
    const std::vector<double> product = times(x), scale = magnitudes.times(length);
    double worst = 0;
    for (int k = 0; k < n; ++k) {
      const double error = std::abs(b[k] - product[k]) / std::max(scale[k] + std::abs(b[k]), 1e-300);
      worst = std::isfinite(error) ? std::max(worst, error) : 1;
    }
    return worst;
  }
  /// Columns of each entry, 1-based: for interfaces that take coordinates.
  [[nodiscard]] std::vector<int> columns() const {
    std::vector<int> result;
    for (int c = 0; c < n; ++c) result.insert(result.end(), pointers[c + 1] - pointers[c], c + 1);
    return result;
  }
};

/// @param spread  entries of H wander over so many decades; @param twins  constraints that repeat the first one: zero
/// eigenvalues
inline Kkt kkt(int unknowns, int constraints, double spread = 0, int twins = 0) {
  Kkt a;
  a.n = unknowns + constraints + twins;
  a.negative = constraints;
  std::mt19937 random(unknowns * 31 + constraints);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int c = 0; c < unknowns; ++c) {
    const auto add = [&](int row, double value) {
      a.rows.push_back(row + 1);
      a.values.push_back(value);
    };
    add(c, (4 + number(random)) * std::pow(10.0, spread * std::abs(number(random))));
    if (c + 1 < unknowns) add(c + 1, 0.5 * number(random));
    // Constraint j has unknowns j, j + 1 and j + 7, as far as there are so many.
    for (int j = 0; j < constraints + twins; ++j) {
      const int like = j < constraints ? j : 0;
      if (c == like) add(unknowns + j, 2);
      if (c == like + 1) add(unknowns + j, -1);
      if (c == like + 7) add(unknowns + j, 0.25);
    }
    a.pointers.push_back(a.entries() + 1);
  }
  for (int j = 0; j < constraints + twins; ++j) {
    a.rows.push_back(unknowns + j + 1);
    a.values.push_back(0);
    a.pointers.push_back(a.entries() + 1);
  }
  return a;
}

}  // namespace espalier::test
