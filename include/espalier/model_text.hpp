/// \file
/// What can be said of a model's text without assembling it: mistakes, and the text as a tree.
#pragma once

#include <string>
#include <vector>

#include "espalier/types.hpp"

namespace espalier {

/// Reads all of a model: keys, kinds, ranges, and names of other parts. Names of faces, quantities and the like are
/// known when a run assembles the bodies. A model need not say what is to be run.
/// @param set  values to be replaced, as SimulationOptions::set
[[nodiscard]] Status check_model(const std::string& path, const std::vector<std::string>& set = {});
/// The same of a text, with a name for messages; files are looked for in the folder of that name.
[[nodiscard]] Status check_model_text(const std::string& text, const std::string& name,
                                      const std::vector<std::string>& set = {});

/// Reads one named part alone. What it refers to is taken to be there: materials, inputs, parameters that `text` does
/// not have. Messages begin with the path in the part: "box: needs three lengths greater than 0".
/// @param text  the part, "bodies.bob = { ... }", and [parameters] that its numbers may use
/// @param file  of the model, whose folder counts for files; it need not exist
[[nodiscard]] Status check_model_part(const std::string& section, const std::string& name, const std::string& text,
                                      const std::string& file);

/// The tables, lists and values of a text as JSON, in their order; NaN and Infinity as JavaScript writes them.
/// @throws Error(invalid_input) "name:line: what" for what is no TOML
[[nodiscard]] std::string model_as_json(const std::string& text, const std::string& name);

/// The keys of parts by section and type, as Python's signatures have them.
struct ModelPartKeys {
  std::string section;            ///< "" for the top of a model
  std::string type;               ///< "" where the section has no types
  std::vector<std::string> keys;  ///< in the order of the sources
};
[[nodiscard]] std::vector<ModelPartKeys> model_part_keys();

}  // namespace espalier
