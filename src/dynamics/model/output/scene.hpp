/// \file
/// What pictures of a motion show: flexible bodies with their meshes, rigid bodies with their surfaces or as boxes,
/// point masses as points.
#pragma once

#include <span>
#include <vector>

#include "dynamics/model/mechanism.hpp"
#include "dynamics/output/vtu.hpp"

namespace espalier::dynamics::model {

/// Cells, fixed over a simulation, and their points at one state.
class Scene {
 public:
  explicit Scene(const Mechanism& mechanism);
  [[nodiscard]] const VtuCells& cells() const { return cells_; }
  [[nodiscard]] const std::vector<Index>& body() const { return body_; }  ///< of each cell, in order of the text
  /// Sets points() and velocity() to those of a state.
  void place(const State& s);
  [[nodiscard]] const std::vector<double>& points() const { return points_; }  ///< 3 per point; so are velocities
  [[nodiscard]] const std::vector<double>& velocity() const { return velocity_; }
  /// The stress of each cell: Cauchy stress in the middle of solids of elements, 0 elsewhere; in linear statics to
  /// first order, at the part of the loads that is the time of the state.
  const std::vector<double>& von_mises(const State& s);
  /// The mark of each cell: 1 where its element had failed at the time of the state, else 0. Empty where no element
  /// can.
  const std::vector<double>& failed(const State& s);
  /// The pressure of each point: pressure of contact at nodes of solids, 0 elsewhere. Empty where no solid has
  /// contacts.
  const std::vector<double>& contact_pressure(const State& s);
  /// The largest extent of the bodies over the largest speed of their points; 0 where nothing moves.
  [[nodiscard]] double extent_over_speed(const State& s);

 private:
  const std::vector<double>& plain_von_mises(const State& s);
  void add_rigid(const BuiltBody& body);
  void add_box(const BuiltBody& body);
  void add_solid(const BuiltBody& body);
  void add_line_or_plate(const BuiltBody& body);
  void add_cell(ElementType type, std::span<const Index> points);

  const Mechanism& mechanism_;
  VtuCells cells_;
  std::vector<Index> body_;
  std::vector<double> position_, rate_;  // of the nodes of a reduced body
  std::vector<double> points_, velocity_, von_mises_, pressure_, failed_;
  struct Cell {
    const double* failed_at;
    std::size_t cell;
  };
  std::vector<Cell> may_fail_;
  std::vector<Index> first_point_;          // of each body
  std::vector<std::vector<Vec3>> corners_;  // of each rigid body, in its axes, in their order
  Index point_count_ = 0;
};

/// Half the edges of the box that stands for a rigid body without surfaces.
[[nodiscard]] Vec3 half_edges(const RigidSpec& rigid);

/// Von Mises stress in the middle of a simulated solid. @param reference, position 3 numbers per node
[[nodiscard]] double von_mises(ElementType type, const Material& material, std::span<const double> reference,
                               std::span<const double> position);

}  // namespace espalier::dynamics::model
