/// \file
/// Modes of a model over one of its numbers: Campbell diagrams, stability over the speed of a steady motion.
#pragma once

#include <string>
#include <vector>

#include "espalier/dynamics.hpp"

namespace espalier {

/// The modes of a model for one value of the number.
struct ModelModesPoint {
  double value = 0;
  std::vector<SimulationMode> modes;  ///< by the modulus of the exponent; those without stiffness, 0, first
  std::vector<std::string> notices;
};

struct ModelModesResult {
  Status status;
  std::string number;  ///< which one is changed
  /// One for each value, in their order; those before a failure stand beside it.
  std::vector<ModelModesPoint> points;
};

/// Modes as `[initial] modes` has them, linearised where the model starts, about its steady motion if it moves, in the
/// equilibrium of `[initial] statics` or `[statics]`, which rotates where `[initial] rotation` says so. No motion is
/// run.
/// @param number  path of a number of the model's text: "initial.rotation.speed" is the one of a Campbell diagram,
///   "parameters.speed" one of the model's own; "": the
///   model is taken as it is, and `values` is one number that counts for nothing
/// @param count  of modes; 0: as many as the model says
ModelModesResult model_modes(const std::string& path, const std::string& number, const std::vector<double>& values,
                             int count = 0, const SimulationOptions& options = {});
/// The same of a text, with a name for messages.
ModelModesResult model_modes_of_text(const std::string& text, const std::string& name, const std::string& number,
                                     const std::vector<double>& values, int count = 0,
                                     const SimulationOptions& options = {});

/// Its rows as CSV: value (where a number is changed), mode, frequency, damping_ratio, growth, whirl,
/// standing_frequency.
[[nodiscard]] std::string modes_table(const ModelModesResult& result);

}  // namespace espalier
