/// \file
/// What the steps of a motion do to its energy that no force does.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics::model {

/// Along a motion q' = v, v' = a the energy changes by the power P = dE/dt of what is in no potential: dampers,
/// friction, motors, moving supports. P follows at each time from a difference of the energy along (v, a), less the
/// power of what the equations of motion F = 0 leave there, v^T F: Newton's iteration ends before a is exact. What the
/// energy changes from step to step beside the integral of P (trapezoids) was made, or lost, by the steps themselves.
/// Three evaluations of the energy and one of F a step; of large systems, which are not to be slowed down by that, only
/// at every 16th.
class EnergyBalance {
 public:
  /// @param speed  velocities below it are nothing (tolerance of the run)
  EnergyBalance(Equations& equations, double speed)
      : equations_(equations),
        system_(equations.system()),
        speed_(speed),
        every_(system_.sizes().velocity > kLarge ? 16 : 1) {}

  /// At the start, and where a state jumps (impacts, events).
  void begin(const State& s) {
    last_ = s;
    known_.reset();
    passed_ = 0;
  }
  /// At the end of a step.
  void step(const State& s);

  [[nodiscard]] double work() const { return work_; }  ///< integral of P
  [[nodiscard]] double gain() const { return gain_; }  ///< of the steps; negative: a loss
  /// Largest kinetic energy, or range of the potential one, or sum of all work, whichever is the largest.
  [[nodiscard]] double scale() const;
  /// A line where the gain is more than a hundredth of the scale, beyond what is uncertain.
  [[nodiscard]] std::optional<std::string> notice() const;

 private:
  static constexpr Index kLarge = 20000;
  struct Rate {
    Energy energy;
    double power = 0;
    [[nodiscard]] double size() const { return std::abs(energy.kinetic) + std::abs(energy.potential); }
  };
  /// @param h  length of the step that begins in s; of the one that ends there, negative
  [[nodiscard]] Rate rate_of(const State& s, double h);
  [[nodiscard]] Rate rate_at_end(const State& s, double h);

  Equations& equations_;
  System& system_;
  double speed_, nothing_ = 0;  // nothing_: kinetic energy where all velocities are speed_
  int every_, passed_ = 0;
  State last_;
  std::optional<Rate> known_;  // of the last state
  double work_ = 0, absolute_work_ = 0, gain_ = 0;
  double uncertainty_ =
      0;  // of the sum of trapezoids: its change without every other point, and rounding of the energies
  double kinetic_ = 0, lowest_ = 0, highest_ = 0;
  bool seen_ = false;
  std::vector<double> q_, v_, change_, left_;
};

}  // namespace espalier::dynamics::model
