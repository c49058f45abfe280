/// \file
/// Restart files: all numbers that the rest of a run depends on, as they stand in memory, and the model that they are
/// of. A file of another format, a damaged one, and one of another model are told apart and refused.
///
///     bytes 0..15   "ESPALIER-RST-4\n", 0
///     bytes 16..23  uint64 checksum (base/checksum.hpp) of everything from byte 24 on
///     bytes 24..63  uint64 each: bytes of the text, numbers, configuration, velocity, constraints
///     then          the text: version of the program, names of all components, keys and values of the model, each text
///                   ended by a zero byte, each list by an empty text; padded with zeros to a multiple of 8
///     then          the numbers, 64-bit IEEE 754; integers little-endian
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dynamics/integrators/integrator.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// The bytes of a restart file. The factor of the integrator is dropped, so that the run that goes on takes the same
/// steps as one that restarts from them.
[[nodiscard]] std::string restart_bytes(Mechanism& mechanism, Integrator& integrator);
/// Takes up their state. @param name for messages @throws Error(invalid_input) as read_restart(); nothing has changed
/// then
void take_restart_bytes(std::string_view bytes, const std::string& name, Mechanism& mechanism, Integrator& integrator);

/// Writes a restart file (under another name, then renamed: a run that is killed leaves the last whole one); see
/// restart_bytes().
/// @throws Error(invalid_input) when it cannot be written
void write_restart(const std::string& path, Mechanism& mechanism, Integrator& integrator);

/// Takes up the state of a file. @param accept_changes whether the model may differ from the one that wrote the file
/// (its components must be the same) @return the differences that were accepted, see differences()
/// @throws Error(invalid_input) when it is no restart file, is damaged, or belongs to another model
[[nodiscard]] std::vector<std::string> read_restart(const std::string& path, bool accept_changes, Mechanism& mechanism,
                                                    Integrator& integrator);

}  // namespace espalier::dynamics::model
