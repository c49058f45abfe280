/// \file
/// Robots of other programs (URDF, MJCF) as texts of models.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dynamics/model/robots/robot.hpp"

namespace espalier::dynamics::model::robots {

struct RobotText {
  std::string text;                  ///< TOML, as simulate reads it; paths in it lead on from the robot's folder
  std::vector<std::string> notices;  ///< what was passed over, counted, and what else is worth knowing
};

/// Whether a file is a robot's by its name: .urdf, .xml, .mjcf, .xacro.
[[nodiscard]] bool is_robot_file(std::string_view path);
/// @param text  of the file  @param path  its name: messages begin with it, and other files are looked for beside it
/// @throws Error(invalid_input) "file:line: what to do"
[[nodiscard]] RobotText robot_as_model(std::string text, const std::string& path, const RobotOptions& options = {});

}  // namespace espalier::dynamics::model::robots
