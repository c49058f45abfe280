/// \file
/// Random changes of a matrix's values.
#pragma once

#include <algorithm>
#include <cstddef>
#include <random>
#include <vector>

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

}  // namespace espalier::verdict
