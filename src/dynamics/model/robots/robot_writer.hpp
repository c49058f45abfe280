/// \file
/// A robot as the text of a model.
#pragma once

#include <string>

#include "dynamics/model/robots/tree.hpp"

namespace espalier::dynamics::model::robots {

/// TOML. What has no counterpart is noted in the robot. @param path  of the robot's file
[[nodiscard]] std::string written_model(Robot& robot, const RobotTree& tree, const std::string& path,
                                        const RobotOptions& options);

}  // namespace espalier::dynamics::model::robots
