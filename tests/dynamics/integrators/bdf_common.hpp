/// \file
/// What the tests of the BDF integrator share.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "dynamics/integrators/bdf.hpp"

namespace espalier::dynamics::test {

/// Fixed step and order; Newton goes down to round-off, so that only the formula's own error is left.
inline BdfOptions fixed(double h, int order) {
  BdfOptions o;
  o.fixed_step = h;
  o.fixed_order = order;
  o.max_newton = 60;
  o.relative = 1e-9;
  o.absolute = 1e-9;
  o.newton_tolerance = 1e-6;  // Newton down to 1e-15
  o.constraint_tolerance = 1e-13;
  return o;
}

/// Largest difference.
inline double distance(const std::vector<double>& x, const std::vector<double>& y) {
  double d = 0;
  for (std::size_t i = 0; i < x.size(); ++i) d = std::max(d, std::abs(x[i] - y[i]));
  return d;
}

}  // namespace espalier::dynamics::test
