/// \file
/// A first model of a mesh file, to edit.
#pragma once

#include <string>

#include "dynamics/mesh/survey.hpp"

namespace espalier::cli {

/// The text of a model that holds one end of the mesh, presses on the other and runs as it is: linear statics.
/// @param mesh  as its file states it, without sides @param model_file  where the text will stand; "": beside the mesh
/// @throws Error where no solids are simulated, or others are among them
std::string first_model(const dynamics::Mesh& mesh, const dynamics::MeshSurvey& survey, const std::string& mesh_file,
                        const std::string& model_file);

}  // namespace espalier::cli
