/// \file
/// Power laws through measured points.
#pragma once

#include <vector>

namespace espalier::bench {

/// y = factor * x^exponent, by least squares on the logarithms.
struct PowerLaw {
  double exponent = 0, factor = 0;
  double r_squared = 0;  ///< share of the variance of log y that the law explains
  int points = 0;        ///< points with different x that were used; below 2 nothing is fitted
};

/// @pre x and y have the same length and are positive
PowerLaw fit_power_law(const std::vector<double>& x, const std::vector<double>& y);

}  // namespace espalier::bench
