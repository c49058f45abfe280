/// \file
/// The surface of a sprocket for roller chains.
#pragma once

#include "dynamics/contact/geometry/triangles.hpp"

namespace espalier::dynamics::contact {

/// Teeth about z with seats for rollers on the pitch circle, radius pitch / (2 sin(pi / teeth)), the first one on x.
/// The profile follows ISO 606: a seat of radius 0.505 roller diameters over the angle 140 degrees - 90 degrees /
/// teeth, then straight flanks along its tangents, up to the tip circle.
struct SprocketShape {
  int teeth = 17;
  double pitch = 0;  ///< of the chain
  double roller_radius = 0;
  double width = 0;   ///< along z, half of it to each side
  double tip = 0.35;  ///< height of the tip circle over the pitch circle, in roller diameters
};
/// @throws std::invalid_argument where rollers, pitch and teeth do not fit each other
[[nodiscard]] TriangleSurface sprocket_surface(const SprocketShape& shape);

}  // namespace espalier::dynamics::contact
