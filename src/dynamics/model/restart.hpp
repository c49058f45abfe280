/// \file
/// Restart files: all numbers that the rest of a run depends on, as they stand in memory.
#pragma once

#include <string>

#include "dynamics/integrators/integrator.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// Writes a restart file (under another name, then renamed: a run that is killed leaves the last whole one). The factor
/// of the integrator is dropped, so that the run that goes on takes the same steps as one that restarts from the file.
/// @throws Error(invalid_input) when it cannot be written
void write_restart(const std::string& path, Mechanism& mechanism, Integrator& integrator);

/// Takes up the state of a file. @throws Error(invalid_input) when it is no restart file or belongs to another model
void read_restart(const std::string& path, Mechanism& mechanism, Integrator& integrator);

}  // namespace espalier::dynamics::model
