/// \file
/// Evenly spaced times at which something is due, whatever the steps.
#pragma once

#include "dynamics/integrators/interpolation.hpp"

namespace espalier::dynamics::model {

/// start + k * interval. An interval of 0: every step; below: never.
struct DueTimes {
  double interval = -1, start = 0;
  long next = 0;
  [[nodiscard]] double due() const { return start + static_cast<double>(next) * interval; }
  /// True (and set to the next time) if something is due at t.
  bool strikes(double t);
  /// The first due time after t.
  void wind_to(double t);
  /// Calls take(state) for all times due up to that of `s`, by interpolation where no step ends there.
  /// @param before  the end of the step before
  template <class Take>
  void visit(const System& system, const State& before, const State& s, const Take& take) {
    if (interval < 0) return;
    if (interval == 0) return take(s);
    const double slip = 1e-9 * interval;  // round-off of a due time
    for (; due() <= s.t + slip; ++next) {
      if (due() < s.t - slip) {
        take(between(system, before, s, due()));
      } else {
        take(s);
      }
    }
  }
};

}  // namespace espalier::dynamics::model
