/// \file
/// What a model is, as a list of keys and values: by it a restart file knows the model that wrote it.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace espalier::dynamics {
class Mesh;
}

namespace espalier::dynamics::model {

struct Value;

/// Dotted paths ("bodies.rod.mass") with their values as text, in the order of the model.
using ModelKeys = std::vector<std::pair<std::string, std::string>>;

/// The keys of an expanded text that say what moves and how. What is written, until when, on which device, and how mesh
/// files are called, may change freely: [output], [solver], title, initial.modes, integrator.end, mesh.file. Parameters
/// count where an expression names them.
[[nodiscard]] ModelKeys model_keys(const Value& root);

/// The content of a mesh file as 16 hexadecimal digits: nodes, elements, sets and materials, not its name.
[[nodiscard]] std::string mesh_digest(const Mesh& mesh);

/// One text for every key that differs: "bodies.rod.mass: 2 then, 3 now". Empty where none does.
[[nodiscard]] std::vector<std::string> differences(const ModelKeys& then, const ModelKeys& now);

}  // namespace espalier::dynamics::model
