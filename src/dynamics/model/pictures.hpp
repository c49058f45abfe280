/// \file
/// Bodies as a series of ParaView files: flexible bodies with their meshes, rigid bodies as boxes.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamics/model/mechanism.hpp"
#include "dynamics/output/vtu.hpp"

namespace espalier::dynamics::model {

/// Point fields: displacement (from the initial state) and velocity; cell fields: body (number in order of the text),
/// von_mises (Cauchy stress in the middle of solids of elements; 0 elsewhere).
class Pictures {
 public:
  /// @param path of the .pvd file @param initial the state from which displacements count
  /// @param keep_until entries of an existing series up to this time are kept (a restarted run); NaN: none
  Pictures(const std::string& path, const Mechanism& mechanism, const State& initial, double keep_until);
  /// @param time what stands for it in the .pvd
  void write(const State& s, double time);
  /// The largest extent of the bodies over the largest speed of their points; 0 where nothing moves.
  [[nodiscard]] double extent_over_speed(const State& s);
  /// Time of the last entry that was kept; none without one.
  [[nodiscard]] std::optional<double> kept() const { return kept_; }
  /// The run has reached its end: entries of earlier runs beyond it are forgotten.
  void finish() { series_.finish(); }

 private:
  void add_rigid(const BuiltBody& body, double number);
  void add_solid(const BuiltBody& body, double number);
  void add_line_or_plate(const BuiltBody& body, double number);
  void add_cell(ElementType type, std::span<const Index> points, double number);
  void place(const State& s);
  void stresses(const State& s);

  const Mechanism& mechanism_;
  PvdSeries series_;
  std::optional<double> kept_;
  VtuCells cells_;
  std::vector<double> initial_, points_, displacement_, velocity_, body_, von_mises_;
  std::vector<Vec3> half_;  // of the boxes, in order of the rigid bodies
  Index point_count_ = 0;
};

/// Von Mises stress in the middle of a simulated solid. @param reference, position 3 numbers per node
[[nodiscard]] double von_mises(ElementType type, const Material& material, std::span<const double> reference,
                               std::span<const double> position);

}  // namespace espalier::dynamics::model
