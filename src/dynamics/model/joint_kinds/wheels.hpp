/// \file
/// What gear pairs, racks and worms ask of their frames.
#pragma once

#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {

/// @throws Error(invalid_input) where the axes of the frames (z) do not cross at a right angle
void check_crossing(JointSpec& j, const FrameBuilder& frames);
/// From the centre of the wheel b to the line z of a, along z_A x z_B: the radius of a wheel that touches it there.
[[nodiscard]] double distance_to_line(const JointStart& start);

/// Of a worm whose frames stand so. @throws std::invalid_argument where the wheel reaches to the worm's axis
[[nodiscard]] WormShape worm_shape(const JointSpec& j, const JointStart& start);

}  // namespace espalier::dynamics::model
