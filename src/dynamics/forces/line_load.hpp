/// \file
/// Force and moment per length along edges of shells, beams and cables.
#pragma once

#include <memory>
#include <vector>

#include "dynamics/dae/frame.hpp"
#include "dynamics/forces/pressed_faces.hpp"

namespace espalier::dynamics {

/// A point of the line with its share of the length.
struct LoadedPoint {
  std::unique_ptr<Frame> frame;
  double length = 0;
};
struct LineLoadLaw {
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();  ///< per length
  bool follower = false;                             ///< they turn with the frames; else they keep to global axes
};
/// What acts where the factor (in the place of the pressure) is one.
[[nodiscard]] std::unique_ptr<PressedFaces> load_line(std::vector<LoadedPoint> points, const LineLoadLaw& law);

}  // namespace espalier::dynamics
