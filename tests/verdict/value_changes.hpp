/// \file
/// Random changes of a matrix's values, and of its pattern.
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "espalier/matrix.hpp"

namespace espalier::verdict {

/// Values that differ from `now` in some way: here and there, near each other, or in what all pivots are measured by.
template <class T>
void change_values(std::vector<T>& now, const std::vector<T>& first, std::mt19937& random) {
  const auto below = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random); };
  const std::size_t n = now.size(), at = below(n);
  switch (below(9)) {
    case 0:
      break;
    case 1:
      now[at] *= 1.5;
      break;
    case 2:
      for (std::size_t k = at; k < std::min(n, at + 12); ++k) now[k] *= 1 + 1e-3 * static_cast<double>(k - at);
      break;
    case 3:
      for (int k = 0; k < 5; ++k) now[below(n)] *= 0.9;
      break;
    case 4:
      now = first;
      break;
    case 5:
      now[at] = 0;
      break;
    case 6:
      now[at] *= 1e4;
      break;
    case 7:
      for (T& v : now) v *= 2;
      break;
    case 8:
      now[at] *= 1e-9;
      break;
  }
}

/// Entries of another matrix come and go: springs between neighbours or across the body, single entries, and back to
/// `first`. @param now  values of `a`, which follow
inline void change_pattern(SparseMatrix& a, std::vector<double>& now, const SparseMatrix& first, std::mt19937& random) {
  const auto below = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random); };
  const auto n = static_cast<std::size_t>(a.cols);
  const std::size_t sort = below(8);
  if (sort == 0) {
    a = first;
    now = first.values;
    return;
  }
  std::map<std::pair<Index, Index>, double> entries;  // (column, row)
  for (std::size_t c = 0; c < n; ++c)
    for (auto q = static_cast<std::size_t>(a.col_ptr[c]); q < static_cast<std::size_t>(a.col_ptr[c + 1]); ++q)
      entries[{static_cast<Index>(c), a.row_ind[q]}] += now[q];
  const double scale = 0.5 + 0.25 * static_cast<double>(below(4));
  const auto add = [&](std::size_t row, std::size_t col, double value) {
    const bool turned =
        (a.storage == Storage::symmetric_lower && row < col) || (a.storage == Storage::symmetric_upper && row > col);
    entries[{static_cast<Index>(turned ? row : col), static_cast<Index>(turned ? col : row)}] += value;
  };
  for (std::size_t k = 0, count = 1 + below(3); k < count; ++k) {
    const std::size_t u = below(n), v = sort < 4 ? std::min(n - 1, u + 1 + below(12)) : below(n);
    if (u == v) continue;
    if (sort == 5) {  // an entry goes, in both triangles if both are there
      for (auto e = entries.begin(); e != entries.end(); ++e) {
        if (e->first.first != static_cast<Index>(u) || e->first.first == e->first.second) continue;
        const std::pair<Index, Index> other{e->first.second, e->first.first};
        entries.erase(e);
        entries.erase(other);
        break;
      }
      continue;
    }
    add(u, u, scale);
    add(v, v, scale);
    add(u, v, -scale);
    if (a.storage == Storage::general || a.storage == Storage::symmetric_both) add(v, u, -scale);
  }
  a.row_ind.clear();
  now.clear();
  a.col_ptr.assign(n + 1, 0);
  for (const auto& [place, value] : entries) {
    a.row_ind.push_back(place.second);
    now.push_back(value);
    a.col_ptr[static_cast<std::size_t>(place.first) + 1] = static_cast<Offset>(now.size());
  }
  for (std::size_t c = 0; c < n; ++c) a.col_ptr[c + 1] = std::max(a.col_ptr[c + 1], a.col_ptr[c]);
  a.values = now;
}

}  // namespace espalier::verdict
