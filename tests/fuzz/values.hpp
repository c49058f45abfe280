/// \file
/// What the fuzz programs of matrix files ask about values.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

namespace espalier::test {

/// Whether every value is smaller than `bound`; NaN is not.
inline bool all_below(std::span<const double> values, double bound) {
  return std::all_of(values.begin(), values.end(), [&](double v) { return std::abs(v) < bound; });
}

}  // namespace espalier::test
