#include "dynamics/joints/time_function.hpp"

#include <algorithm>
#include <stdexcept>

namespace espalier::dynamics {

TimeFunction TimeFunction::constant(double c) {
  TimeFunction f;
  f.value = [c](double) { return c; };
  return f;
}

TimeFunction TimeFunction::linear(double c, double s) {
  TimeFunction f;
  f.value = [c, s](double t) { return c + s * t; };
  f.rate = [s](double) { return s; };
  return f;
}

TimeFunction TimeFunction::smooth_step(double t0, double from, double t1, double to) {
  if (!(t1 > t0)) throw std::invalid_argument("smooth_step: the end must be later than the beginning");
  const double length = t1 - t0, height = to - from;
  const auto place = [=](double t) { return std::clamp((t - t0) / length, 0.0, 1.0); };
  TimeFunction f;
  f.value = [=](double t) {
    const double s = place(t);
    return from + height * s * s * s * (10 + s * (-15 + 6 * s));
  };
  f.rate = [=](double t) {
    const double s = place(t);
    return height / length * 30 * s * s * (1 - s) * (1 - s);
  };
  f.acceleration = [=](double t) {
    const double s = place(t);
    return height / (length * length) * 60 * s * (1 - s) * (1 - 2 * s);
  };
  f.branches = [=](double t, Branches& out) { out.push_back({level_of_step((t - t0) / length), true, true}); };
  return f;
}

}  // namespace espalier::dynamics
