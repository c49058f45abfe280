/// \file
/// From the text to the plain model: parameters, overrides, repetitions.
#pragma once

#include <string>
#include <vector>

#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {

/// Works off, in this order,
///   1. `overrides`: PATH=VALUE each (see set_value());
///   2. [parameters]: numbers, or expressions of the ones before them;
///   3. {expression} in names and texts is replaced by its value;
///   4. [[repeat]]: its sections (bodies, markers, joints, forces) are copied once for each index from `from` to `to`,
///      with the index known to their expressions, and added to the sections of the model;
///   5. values that are written with a unit become numbers (units/apply_units.hpp);
/// and gives every text the scope in which its expressions are read. The tables parameters and repeat are gone then.
/// @throws Error(invalid_input) "file:line: path: what"
void expand(Value& root, const std::vector<std::string>& overrides);

/// A number of a text by its path, after overrides; an expression in [parameters] counts as its value.
/// @throws Error(invalid_input) where there is none
[[nodiscard]] double number_at(Value root, const std::vector<std::string>& overrides, const std::string& path);

/// The text of a number as it appears in names: 3, not 3.0.
[[nodiscard]] std::string number_text(double value);

}  // namespace espalier::dynamics::model
