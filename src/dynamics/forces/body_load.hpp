/// \file
/// Loads on the material of a body: weight, forces per volume, centrifugal forces.
#pragma once

#include <memory>
#include <span>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/elements/solid_parts.hpp"
#include "dynamics/forces/pressed_faces.hpp"

namespace espalier::dynamics {

/// Force per reference volume: per_volume + density (acceleration + w x ((x - point) x w)), in global axes; the last
/// term is the centrifugal force in axes that turn with the angular velocity w, at the place x where the material is.
struct BodyLoadLaw {
  Vec3 acceleration = Vec3::Zero(), per_volume = Vec3::Zero();
  Vec3 spin = Vec3::Zero();  ///< w
  Vec3 point = Vec3::Zero();
};

/// On elements of the mesh that a solid was made of. What a "pressure" of one is there is a factor of one here.
/// @param elements  empty: all @param body  of a system already
/// @throws std::invalid_argument unless the body is a solid
[[nodiscard]] std::unique_ptr<PressedFaces> load_material(const FlexibleBody& body, const Mesh& mesh,
                                                          std::span<const Index> elements,
                                                          const ElementMaterials& materials, const BodyLoadLaw& law);

/// On all elements of any flexible body, by its consistent mass: M (acceleration + w x ((x - point) x w)), which is
/// exact for all vertices, since places of the material are linear in them. @param law  without a force per volume
[[nodiscard]] std::unique_ptr<PressedFaces> load_mass(const FlexibleBody& body, const BodyLoadLaw& law);

}  // namespace espalier::dynamics
