/// \file
/// Functions of time with two derivatives, for motors and prescribed motions.
#pragma once

#include <functional>

#include "dynamics/dae/switching.hpp"

namespace espalier::dynamics {

/// f(t), f'(t), f''(t). Default: zero.
struct TimeFunction {
  std::function<double(double)> value = [](double) { return 0.0; };
  std::function<double(double)> rate = [](double) { return 0.0; };
  std::function<double(double)> acceleration = [](double) { return 0.0; };
  /// Appends where it has corners, see Branch; empty: nowhere.
  std::function<void(double, Branches&)> branches;

  [[nodiscard]] static TimeFunction constant(double c);
  /// c + s t
  [[nodiscard]] static TimeFunction linear(double c, double s);
  /// From `from` at t0 to `to` at t1 by the quintic with zero rates and accelerations at both ends; constant outside.
  [[nodiscard]] static TimeFunction smooth_step(double t0, double from, double t1, double to);
};

}  // namespace espalier::dynamics
