/// \file
/// Frames of joints and forces as they are meant: axes that the text leaves out, and how faces are held.
#pragma once

#include <string>
#include <vector>

#include "dynamics/model/build/builders.hpp"

namespace espalier::dynamics::model {

/// The joint with its markers resolved. Where the direction of its axis matters, one of two frames must say it; the
/// other takes the same axes, as the bodies stand at the start, unless its z axis has that direction already. Faces of
/// solids are held as `attach` says, in fixed joints rigidly where nothing does: a line of `notices` says so.
/// @throws Error(invalid_input) where an axis is missing, or `attach` has nothing to hold
[[nodiscard]] JointSpec completed(const JointSpec& joint, const FrameBuilder& frames, const Mechanism& built,
                                  std::vector<std::string>& notices);
/// The same of a force.
[[nodiscard]] ForceSpec completed(const ForceSpec& force, const FrameBuilder& frames, const Mechanism& built);

/// Constraints that make the nodes of a marker with attach = rigid one rigid piece: 3 k - 6 for k nodes. The distances
/// of three of them, on which the marker's frame stands, and the places of the others beside that frame. Nothing for
/// other markers, and for nodes that are one piece already.
void hold_rigidly(const MarkerSpec& marker, const FrameBuilder& frames, Mechanism& out);

}  // namespace espalier::dynamics::model
