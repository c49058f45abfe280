/// \file
/// `espalier modes MODEL.toml`: modes of a model over its speed of rotation, or another number.
#pragma once

#include <string>
#include <vector>

#include "common/progress.hpp"
#include "espalier/model_modes.hpp"
#include "pencils/pencil_command.hpp"

namespace espalier::cli {

struct ModelModesCommand {
  std::string model, speeds, over, csv_file;
  int count = 0;
  SimulationOptions options;
  PencilOutput output;
};

/// @return the exit code @throws Error for values that are none
int run_model_modes(const ModelModesCommand& command, Progress& progress);

}  // namespace espalier::cli
