/// \file
/// Values along a path through a body.
#pragma once

#include "dynamics/model/output/quantities.hpp"

namespace espalier::dynamics::model {

class FieldPath {
 public:
  /// @throws Error(invalid_input) for a body, a quantity or points that are not there
  FieldPath(Mechanism& mechanism, const PathSpec& spec);
  /// In linear statics to first order, as all quantities.
  [[nodiscard]] SimulationPath at(const Sample& s) const;

 private:
  Mechanism& mechanism_;
  std::string name_, body_;
  std::vector<Vec3> points_;
  std::vector<double> length_;
  std::vector<Quantity> quantities_;
};

/// Writes paths as a table: path, time, length, x, y, z, and a column for each quantity of any of them.
void write_paths(const std::string& file, const std::vector<SimulationPath>& paths);

}  // namespace espalier::dynamics::model
