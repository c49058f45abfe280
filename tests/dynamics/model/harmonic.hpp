/// \file
/// A function of time that is never flat.
#pragma once

#include <cmath>

#include "dynamics/joints/time_function.hpp"

namespace espalier::dynamics {

/// c + a sin(w t + p)
inline TimeFunction harmonic(double c, double a, double w, double p) {
  TimeFunction f;
  f.value = [=](double t) { return c + a * std::sin(w * t + p); };
  f.rate = [=](double t) { return a * w * std::cos(w * t + p); };
  f.acceleration = [=](double t) { return -a * w * w * std::sin(w * t + p); };
  return f;
}

}  // namespace espalier::dynamics
