/// \file
/// Whether a vibration holds the steps of a run short.
#pragma once

#include <optional>
#include <string>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics::model {

/// In each step the coordinate whose acceleration changes most tells a frequency: with the error of the trapezoidal
/// rule, dv - h (a0 + a1) / 2 = -h^3 v''' / 12, and da = h v'', it is |v'''| / |v''|. Steps of adaptive methods that are
/// a small, even part of its period follow it.
class HeldSteps {
 public:
  void begin(const State& s) { last_ = s; }
  void step(const State& s);
  /// A line where most steps follow one vibration for very many periods.
  [[nodiscard]] std::optional<std::string> notice() const;

 private:
  State last_;
  long steps_ = 0, held_ = 0;
  double time_ = 0, log_frequency_ = 0, log_square_ = 0, fastest_ = 0;
};

}  // namespace espalier::dynamics::model
