/// \file
/// The shapes of a robot as text: surfaces, and the contacts between them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dynamics/model/robots/tree.hpp"

namespace espalier::dynamics::model::robots {

/// [surfaces] and [contacts]. Meshes of which no surface can be made are noted in the robot.
/// @param bodies  names of the tree's moving bodies  @param take  makes a name of the model's parts of a wish
/// @param path  of the robot's file
[[nodiscard]] std::string shapes_text(Robot& robot, const RobotTree& tree, const std::vector<std::string>& bodies,
                                      const std::function<std::string(const std::string&)>& take,
                                      const std::string& path, const RobotOptions& options);

}  // namespace espalier::dynamics::model::robots
