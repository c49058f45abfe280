/// \file
/// Bodies as a series of ParaView files.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/background.hpp"
#include "dynamics/model/scene.hpp"
#include "dynamics/output/vtu.hpp"

namespace espalier::dynamics::model {

/// Point fields: displacement (from the initial state) and velocity; cell fields: body (number in order of the text),
/// von_mises.
class Pictures {
 public:
  /// @param path of the .pvd file @param initial the state from which displacements count
  /// @param keep_until entries of an existing series up to this time are kept (a restarted run); NaN: none
  Pictures(const std::string& path, const Mechanism& mechanism, const State& initial, double keep_until);
  /// The file is written beside what the caller does next. @param time what stands for it in the .pvd
  /// @throws Error(invalid_input) when this file or an earlier one cannot be written
  void write(const State& s, double time);
  /// As Scene's.
  [[nodiscard]] double extent_over_speed(const State& s) { return scene_.extent_over_speed(s); }
  /// Time of the last entry that was kept; none without one.
  [[nodiscard]] std::optional<double> kept() const { return kept_; }
  /// Until all files are written. @throws Error(invalid_input) when one cannot be
  void catch_up() { background_.wait(); }
  /// The run has reached its end: entries of earlier runs beyond it are forgotten.
  void finish();

 private:
  struct Picture;

  Scene scene_;
  PvdSeries series_;  // from write() to catch_up() the background's
  std::optional<double> kept_;
  std::vector<double> initial_, body_;
  base::Background background_;  // uses what stands above
};

}  // namespace espalier::dynamics::model
