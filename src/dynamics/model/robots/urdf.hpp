/// \file
/// Robots of ROS: URDF.
#pragma once

#include "dynamics/model/robots/robot.hpp"
#include "dynamics/model/robots/xml.hpp"

namespace espalier::dynamics::model::robots {

/// @throws Error(invalid_input) "file:line: ..."
[[nodiscard]] Robot read_urdf(const XmlFile& file, const RobotOptions& options);

}  // namespace espalier::dynamics::model::robots
