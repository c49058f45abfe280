/// \file
/// What gear pairs, racks and worms ask of their frames.
#pragma once

#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {

/// @throws Error(invalid_input) where the axes of the frames (z) do not cross at a right angle
void check_crossing(JointSpec& j, const FrameBuilder& frames);
/// From the centre of the wheel b to the line z of a, along z_A x z_B: the radius of a wheel that touches it there.
[[nodiscard]] double distance_to_line(const JointStart& start);

/// Gear pairs and rack pairs.
[[nodiscard]] constexpr bool has_spur_teeth(JointType type) {
  return type == JointType::gear_pair || type == JointType::rack_pair;
}
/// @throws Error(invalid_input) for an angle below 0 or from a right angle on
[[nodiscard]] double checked_pressure_angle(double angle, const Place& place);
/// The coordinate along which the teeth of a gear pair or a rack pair press its frames apart (factor 1), or together
/// (factor -1: inner teeth).
struct Separation {
  PairCoordinate coordinate;
  double factor = 1;
};
[[nodiscard]] Separation separation_of(const JointSpec& j, const JointStart& start);
/// Along which the pitch circles of a gear pair, or pinion and rack, run: its rate is the speed at the pitch point.
[[nodiscard]] PairCoordinate pitch_line(const JointSpec& j, const JointStart& start);

/// The shape of a worm whose frames stand so. @throws std::invalid_argument where the wheel reaches to the worm's axis
[[nodiscard]] WormShape worm_shape(const JointSpec& j, const JointStart& start);

}  // namespace espalier::dynamics::model
