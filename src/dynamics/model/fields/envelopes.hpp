/// \file
/// Extremes of quantities over a run, with the time and the place where they are.
#pragma once

#include "dynamics/model/output/quantities.hpp"
#include "espalier/dynamics.hpp"

namespace espalier::dynamics::model {

class Envelopes {
 public:
  /// @param requests  quantities; of stresses and the like without a statistic over all places that are named
  /// @throws Error(invalid_input) naming the request
  Envelopes(Mechanism& mechanism, const std::vector<std::string>& requests, const Place& place);
  /// At the start, and at the end of each step.
  void take(const Sample& s);
  [[nodiscard]] const std::vector<SimulationEnvelope>& found() const { return found_; }

 private:
  struct Pair {
    Quantity largest, least;
  };
  std::vector<Pair> quantities_;
  std::vector<SimulationEnvelope> found_;
  bool begun_ = false;
};

}  // namespace espalier::dynamics::model
