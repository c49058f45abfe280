/// \file
/// A joint that couples two slides.
#pragma once

#include "dynamics/joints/joint.hpp"

namespace espalier::dynamics {

/// Displacement of B along z_A * ratio + displacement of D along z_C = const (as at the first evaluation).
[[nodiscard]] std::unique_ptr<Joint> coupled_slides(std::string name, FramePtr a, FramePtr b, FramePtr c, FramePtr d,
                                                    double ratio);

}  // namespace espalier::dynamics
