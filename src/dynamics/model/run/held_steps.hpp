/// \file
/// Whether a vibration holds the steps of a run short.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics::model {

/// Counts how often the acceleration of each coordinate turns round. The coordinate whose acceleration changes most,
/// all steps together, tells the vibration that they follow.
class HeldSteps {
 public:
  void begin(const State& s) { last_ = s.a, time_ = s.t; }
  void step(const State& s);
  /// A line where the steps follow a vibration for very many periods.
  [[nodiscard]] std::optional<std::string> notice() const;

 private:
  struct Coordinate {
    double way = 0;  ///< sum of |da|
    long turns = 0;
    bool rises = false;
  };
  std::vector<Coordinate> coordinates_;
  std::vector<double> last_;
  long steps_ = 0;
  double time_ = 0, duration_ = 0, fastest_ = 0;
};

}  // namespace espalier::dynamics::model
