/// \file
/// Decks of other programs as parts of a model: what `take` beside a mesh file asks for becomes entries of the model's
/// own sections, so that all that follows is the same.
#pragma once

#include <string>

#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {

/// Whether a body of an expanded text takes something from its mesh file.
[[nodiscard]] bool takes_decks(const Value& root);
/// Adds what the decks state. @param folder  where mesh files are looked for
/// @throws Error(invalid_input) with the line of the deck where something cannot be taken
void take_decks(Value& root, const std::string& folder);

/// The text of the model in a file: of a deck one line that takes all of it. @throws Error where it cannot be read
[[nodiscard]] std::string read_model_text(const std::string& path);

}  // namespace espalier::dynamics::model
