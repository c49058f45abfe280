/// \file
/// Names that stand where a frame is asked for: those of markers, of bodies, "ground", and frames of other joints.
#pragma once

#include <vector>

#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {

/// Frames in line that have a name become markers, and the frames refer to them. @throws Error(invalid_input) where a
/// marker has the name already
void keep_named_frames(std::vector<MarkerSpec>& frames, Description& model);

/// Every name that stands for a frame and is no marker's becomes the frame that it means: "ground" (its origin and
/// axes), a body (its origin: of a rigid body the centre of mass, of a point mass the point; flexible bodies have to
/// say where), or a frame of a joint or force, "hinge.a". Markers have names of their own, so nothing is ambiguous.
/// @throws Error(invalid_input) for names that nobody knows
void settle_frame_names(Description& model);

}  // namespace espalier::dynamics::model
