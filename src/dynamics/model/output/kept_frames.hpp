/// \file
/// Pictures of a run that are kept in memory.
#pragma once

#include <vector>

#include "dynamics/model/output/scene.hpp"
#include "dynamics/model/run/due_times.hpp"
#include "espalier/dynamics.hpp"

namespace espalier::dynamics::model {

class KeptFrames {
 public:
  /// @param interval as SimulationOptions::frame_interval @param from  displacements count from this state
  KeptFrames(const Mechanism& mechanism, double interval, const State& from);
  /// The first state, which is kept. Times are counted from `start`.
  void begin(const State& s, double start);
  void step(const State& s);
  /// The run goes on from another state: what was kept of later ones goes.
  void restore(const State& s);
  [[nodiscard]] const std::vector<SimulationFrame>& frames() const { return frames_; }
  /// The frame of any state.
  [[nodiscard]] SimulationFrame frame(const State& s);
  [[nodiscard]] SimulationMesh mesh() const;

 private:
  void take(const State& s);

  const Mechanism& mechanism_;
  Scene scene_;
  std::vector<double> from_;
  DueTimes times_;
  State before_;  // at the end of the step before
  std::vector<SimulationFrame> frames_;
};

}  // namespace espalier::dynamics::model
