/// \file
/// Values that are written with a unit become numbers in the model's own units.
#pragma once

#include "dynamics/model/read/value.hpp"
#include "dynamics/model/units/unit_system.hpp"

namespace espalier::dynamics::model {

/// The system that the text states under `units`; nothing where it states none.
/// @throws Error(invalid_input) with the place where it is no system
[[nodiscard]] std::optional<UnitSystem> stated_units(const Value& root);

/// A number of a table whose keys have no dimension of their own ([parameters]) where it is written with a unit, in the
/// model's units; nothing where it is something else. @throws Error(invalid_input) with the place
[[nodiscard]] std::optional<double> parameter_with_unit(const Value& value, const std::optional<UnitSystem>& units);

/// Replaces every text under a key of numbers that is a number or a list with a unit. @pre parameters and repetitions
/// are worked off @throws Error(invalid_input) with the place: a unit that nobody knows or of another dimension than
/// the key, or any in a model that does not state its own
void apply_units(Value& root);

}  // namespace espalier::dynamics::model
