/// \file
/// Masses of geoms, as MuJoCo infers them where a body states none.
#pragma once

#include <vector>

#include "dynamics/model/robots/robot.hpp"

namespace espalier::dynamics::model::robots {

/// How the inertia of a mesh is found: of the volume inside (exact), with the volumes of all pyramids to its centre
/// taken positive (legacy), or of its triangles as a thin shell.
enum class MeshInertia { exact, legacy, shell };

/// Volume (of a shell: area) of a geom and its inertia at density 1, about its centre, in the axes of its link.
/// @throws Error(invalid_input) for meshes that cannot be read or have no volume
[[nodiscard]] Mass unit_mass(const Geom& geom, bool shell, MeshInertia mesh);

/// No less than a mass and a principal moment, and, where asked for, three equal moments where the largest exceeds the
/// sum of the others.
[[nodiscard]] Mass bounded(Mass mass, double least_mass, double least_inertia, bool balanced);
/// Sum of masses, about the centre of all.
[[nodiscard]] Mass sum_of(const std::vector<Mass>& parts);
/// The same mass seen from other axes. @param pose  of its axes in those
[[nodiscard]] Mass moved(const Mass& mass, const Pose& pose);

}  // namespace espalier::dynamics::model::robots
