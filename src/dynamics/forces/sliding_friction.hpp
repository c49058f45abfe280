/// \file
/// Coulomb and viscous friction of a point that slides on a surface in any direction.
#pragma once

#include "dynamics/forces/joint_friction.hpp"
#include "dynamics/joints/pair_function.hpp"

namespace espalier::dynamics {

/// On the origin of B, against its velocity v along the surface as seen from A: -(N mu(|v|) / |v| + viscous) v. The
/// surface is a function of the point that is zero on it. Input 0 is N.
[[nodiscard]] std::unique_ptr<FrameForce> sliding_friction(std::string name, FramePtr a, FramePtr b,
                                                           std::shared_ptr<const PointFunction> surface,
                                                           const FrictionCurve& curve, double viscous);

}  // namespace espalier::dynamics
