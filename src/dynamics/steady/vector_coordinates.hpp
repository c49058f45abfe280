/// \file
/// Which velocity coordinates of a system are vectors: what turns when the whole is seen from other axes.
#pragma once

#include <vector>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/dae/assembled_system.hpp"

namespace espalier::dynamics {

/// Three velocity coordinates from v on that are a vector. Those of no vector are numbers in axes that turn with their
/// body (amplitudes of a reduced body).
struct VectorCoordinates {
  enum class Kind {
    place,      ///< change of a position, global axes; q: where the position stands
    direction,  ///< change of a vector that is fixed to the material, global axes; q: where it stands
    turn        ///< increment of a rotation, body axes; q: where the quaternion of the body stands
  };
  Kind kind = Kind::place;
  Index v = 0, q = 0;
  const Component* body = nullptr;

  /// Its axes in global ones.
  [[nodiscard]] Mat3 axes(ConstSpan configuration) const;
  /// The position or direction. @pre kind is one of them
  [[nodiscard]] Vec3 value(ConstSpan configuration) const;
};

[[nodiscard]] std::vector<VectorCoordinates> vector_coordinates(const AssembledSystem& system);

/// The angular velocity of a body whose coordinates are these, global axes: of the rigid motion nearest to its
/// velocities; zero of a point. @param all  those of one body
[[nodiscard]] Vec3 angular_velocity(std::span<const VectorCoordinates> all, ConstSpan q, ConstSpan v);

}  // namespace espalier::dynamics
