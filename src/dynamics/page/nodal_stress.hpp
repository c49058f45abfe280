/// \file
/// Stress at the surface of solids, for colours.
#pragma once

#include <vector>

#include "dynamics/page/drawn.hpp"

namespace espalier::dynamics::page {

/// Cauchy stress at the nodes of outer faces: the mean of what the elements around a node say. An element of straight
/// edges says what it has in its middle; one of 10 or 20 nodes what follows from its 4 or 8 points by a linear law.
class NodalStress {
 public:
  NodalStress(const model::Mechanism& mechanism, const Drawn& drawn);
  [[nodiscard]] bool empty() const { return bodies_.empty(); }
  /// What has to be kept of a state until evaluate(): positions of the nodes of each solid.
  [[nodiscard]] std::vector<std::vector<double>> positions(const State& s) const;
  /// At all points of flexible bodies; NaN on those that are no solids. May run beside the simulation.
  void evaluate(const std::vector<std::vector<double>>& positions, std::vector<double>& von_mises,
                std::vector<double>& principal) const;

 private:
  struct Solid {
    const model::BuiltBody* body;
    std::size_t first_point;      // among those of flexible bodies
    std::vector<Index> elements;  // with a node that is drawn
    std::vector<Index> point_of;  // of each node; -1: it is not drawn
    std::size_t points;
  };
  std::vector<Solid> bodies_;
  std::size_t points_ = 0;
};

}  // namespace espalier::dynamics::page
