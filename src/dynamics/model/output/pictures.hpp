/// \file
/// Bodies in files for ParaView.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/background.hpp"
#include "dynamics/model/output/scene.hpp"
#include "dynamics/output/vtkhdf.hpp"

namespace espalier::dynamics::model {

/// Point fields: displacement (from the initial state), velocity and, where solids have contacts, contact_pressure;
/// cell fields: body (number in order of the text), von_mises and, where elements can fail, failed (1 where one has).
/// As one file, with quantities, or as a series of .vtu.
class Pictures {
 public:
  /// @param name  of the series, NAME.pvd or NAME.vtkhdf (of "motion": results.vtkhdf)
  /// @param initial  from which displacements count
  /// @param keep_until  what files of an earlier run hold up to this time is kept (a restarted run); NaN: nothing
  /// @param quantities  names of what is written with each picture, in files that have room for it
  Pictures(const std::string& folder, const std::string& name, PictureFormat format, const Mechanism& mechanism,
           const State& initial, double keep_until, std::vector<std::string> quantities = {});
  /// The file is written beside what the caller does next. @param time what stands for it there
  /// @throws Error(invalid_input) when this picture or an earlier one cannot be written
  void write(const State& s, double time, std::vector<double> quantities = {});
  [[nodiscard]] const std::string& path() const { return path_; }
  /// As Scene's.
  [[nodiscard]] double extent_over_speed(const State& s) { return scene_.extent_over_speed(s); }
  /// Time of the last entry that was kept; none without one.
  [[nodiscard]] std::optional<double> kept() const { return kept_; }
  /// Until all files are written. @throws Error(invalid_input) when one cannot be
  void catch_up();
  /// The run has reached its end: entries of earlier runs beyond it are forgotten.
  void finish();

 private:
  struct Picture;

  void write_vtu(const Picture& picture);
  void write_frame(const Picture& picture);

  Scene scene_;
  std::string path_;
  // One of them; from write() to catch_up() the background's.
  std::unique_ptr<PvdSeries> series_;
  std::unique_ptr<VtkHdf> file_;
  std::optional<double> kept_;
  std::vector<double> initial_, body_;
  base::Background background_;  // uses what stands above
};

}  // namespace espalier::dynamics::model
