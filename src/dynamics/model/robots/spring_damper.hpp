/// \file
/// Springs and dampers that are given by how a joint swings with them.
#pragma once

#include "dynamics/model/robots/tree.hpp"

namespace espalier::dynamics::model::robots {

/// Gives joints with a `springdamper` (time constant T, damping ratio z) a stiffness I / (T z)^2 and a damping 2 I / T,
/// as MuJoCo's compiler does: I is the inverse of the joint's part of the inverse mass matrix with all joints at `ref`,
/// of balls the mean of that part.
void set_spring_dampers(RobotTree& tree);

}  // namespace espalier::dynamics::model::robots
