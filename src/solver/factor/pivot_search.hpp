/// \file
/// Where pivots that vanish or are small have to go, by the host's values.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "solver/factor/numeric.hpp"

namespace espalier::solver {

/// Smaller pivots than `smallest`, relative to the largest scaled entry, vanish.
struct Vanishing {
  double smallest = 0;
  bool parts = false;  ///< see Numeric::part_with_zeros()
};
/// Where pivots have to go, by values that are scaled for it.
std::optional<std::vector<analysis::PivotMove>> place_pivots(const Analysis& analysis, const Scales& scales,
                                                             std::span<const double> values,
                                                             std::span<const double> border_values, Vanishing vanishing,
                                                             std::span<const Index> failed, const Context& context);

}  // namespace espalier::solver
