/// \file
/// Joints hold faces where they are: frames that do not fit at the start are moved on their bodies, not the bodies.
#pragma once

#include <string>
#include <vector>

#include "dynamics/model/build/builders.hpp"

namespace espalier::dynamics::model {

/// Frames of a joint of two frames. Where they do not fit and one of them stands on a flexible body, that one is moved
/// to the other (both flexible: b to a): the weights of a face are shifted where that can be, else the mean carries the
/// frame by an arm. A node has no axes to carry with: then the frame on the rigid body or the ground moves. What was
/// done is a line of `notices`. With `pull` nothing is moved.
[[nodiscard]] std::vector<FramePtr> held_frames(const JointSpec& joint, const FrameBuilder& frames,
                                                const Mechanism& built, std::vector<std::string>& notices);

}  // namespace espalier::dynamics::model
