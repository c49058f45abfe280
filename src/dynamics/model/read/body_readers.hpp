/// \file
/// What reads the bodies of a model: one function for each kind, a row each in read_bodies.cpp.
#pragma once

#include "dynamics/model/read/read_materials.hpp"

namespace espalier::dynamics::model {

using BodyShape = decltype(BodySpec::shape);

[[nodiscard]] BodyShape read_rigid(Section& s, BodyMaterials& materials);
[[nodiscard]] BodyShape read_point(Section& s, BodyMaterials& materials);
[[nodiscard]] BodyShape read_solid(Section& s, BodyMaterials& materials);
[[nodiscard]] BodyShape read_substructure(Section& s, BodyMaterials& materials);
[[nodiscard]] BodyShape read_cable(Section& s, BodyMaterials& materials);
[[nodiscard]] BodyShape read_beam(Section& s, BodyMaterials& materials);
[[nodiscard]] BodyShape read_shell(Section& s, BodyMaterials& materials);

/// `damping` and `reduce` of a flexible body.
void read_body_damping(Section& s, BodySpec& body);

// Meshes

/// The most elements of one body. More have unknowns that no machine holds, and 32-bit numbers do not reach.
inline constexpr double kMostElements = 1e8;
/// A number of elements.
[[nodiscard]] Index read_elements(Section& s, const std::string& key, int otherwise);
/// A path of the model, relative to its folder.
[[nodiscard]] std::string beside_model(const Description& model, const std::string& given);
/// A file, or a part from one of our meshers.
[[nodiscard]] std::variant<MeshFile, MesherSpec> read_mesh_source(Section s, const Description& model);
/// A file. @param whose  mesh it is: "of a shell"
[[nodiscard]] MeshFile read_mesh_file(Section& mesh, const Description& model, const std::string& whose);

}  // namespace espalier::dynamics::model
