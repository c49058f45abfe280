/// \file
/// Dense references for condensed systems.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "espalier/schur.hpp"
#include "matrix/generators/generate.hpp"
#include "reference/reference.hpp"

namespace espalier::test {

inline constexpr double kEps = std::numeric_limits<double>::epsilon();

inline SparseMatrix generated(std::vector<std::string> words) {
  return matrix::generate(matrix::parse_generator(words));
}

/// Unknowns that are not listed, ascending.
inline std::vector<Index> rest_of(Index n, const std::vector<Index>& list) {
  std::vector<Index> rest;
  for (Index v = 0; v < n; ++v)
    if (std::find(list.begin(), list.end(), v) == list.end()) rest.push_back(v);
  return rest;
}

/// A(rows, cols), column-major, of a dense n x n.
inline std::vector<double> part(const std::vector<double>& a, std::size_t n, const std::vector<Index>& rows,
                                const std::vector<Index>& cols) {
  std::vector<double> p;
  for (const Index c : cols)
    for (const Index r : rows) p.push_back(a[static_cast<std::size_t>(c) * n + static_cast<std::size_t>(r)]);
  return p;
}

/// A dense matrix as a sparse one in general storage, zeros left out.
inline SparseMatrix sparse(const std::vector<double>& a, Index n) {
  std::vector<reference::Triple> t;
  for (Index c = 0; c < n; ++c)
    for (Index r = 0; r < n; ++r)
      if (const double v = a[static_cast<std::size_t>(c) * static_cast<std::size_t>(n) + static_cast<std::size_t>(r)];
          v != 0)
        t.push_back({r, c, v});
  return reference::from_triples(n, t, Storage::general);
}

/// c -= a b, column-major: c is rows x cols.
inline void subtract_product(const std::vector<double>& a, const std::vector<double>& b, std::vector<double>& c,
                             std::size_t rows, std::size_t inner, std::size_t cols) {
  for (std::size_t j = 0; j < cols; ++j)
    for (std::size_t k = 0; k < inner; ++k)
      for (std::size_t i = 0; i < rows; ++i) c[j * rows + i] -= a[k * rows + i] * b[j * inner + k];
}

/// A_ss - A_sr A_rr^-1 A_rs by dense elimination.
inline std::vector<double> dense_complement(const MatrixView& a, const std::vector<Index>& list) {
  const auto n = static_cast<std::size_t>(a.cols);
  const std::vector<double> full = reference::dense(a);
  const std::vector<Index> rest = rest_of(a.cols, list);
  std::vector<double> s = part(full, n, list, list);
  if (rest.empty()) return s;
  const auto columns = static_cast<Index>(list.size());
  const SparseMatrix rr = sparse(part(full, n, rest, rest), static_cast<Index>(rest.size()));
  const std::vector<double> x = reference::solve(rr, part(full, n, rest, list), columns, false);
  subtract_product(part(full, n, list, rest), x, s, list.size(), rest.size(), list.size());
  return s;
}

inline double largest(const std::vector<double>& v) {
  double most = 0;
  for (const double x : v) most = std::max(most, std::abs(x));
  return most;
}

/// `count` of n unknowns in random order.
inline std::vector<Index> random_list(Index n, Index count, std::uint64_t seed) {
  std::vector<Index> all(static_cast<std::size_t>(n));
  std::iota(all.begin(), all.end(), 0);
  std::mt19937_64 random(seed);
  std::shuffle(all.begin(), all.end(), random);
  all.resize(static_cast<std::size_t>(count));
  return all;
}

}  // namespace espalier::test
