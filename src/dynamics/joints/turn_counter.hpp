/// \file
/// An angle with its turns counted.
#pragma once

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// Remembers angle and speed of the last accepted state. An angle that is known up to whole turns is taken on the
/// branch nearest to the one that the speed leads to, so a step may turn as far as it likes if only the speed changes
/// the angle by less than half a turn in it. Trial states do not count: a rejected one may lie on another branch.
class TurnCounter {
 public:
  /// @param angle in any branch @param t time of the state
  [[nodiscard]] double unwrapped(double angle, double t) const {
    if (std::isnan(angle_)) return angle;
    constexpr double kTurn = 2 * std::numbers::pi;
    return angle + kTurn * std::round((angle_ + rate_ * (t - t_) - angle) / kTurn);
  }
  void accept(double angle, double rate, double t) {
    angle_ = unwrapped(angle, t);
    rate_ = rate;
    t_ = t;
  }
  void save(std::vector<double>& out) const { out.insert(out.end(), {angle_, rate_, t_}); }
  /// @throws Error(invalid_input) if the numbers end too early
  void restore(ConstSpan& in) {
    if (in.size() < 3) throw Error(StatusCode::invalid_input, "the restart file ends too early");
    angle_ = in[0], rate_ = in[1], t_ = in[2];
    in = in.subspan(3);
  }

 private:
  double angle_ = std::numeric_limits<double>::quiet_NaN(), rate_ = 0, t_ = 0;
};

}  // namespace espalier::dynamics
