/// \file
/// Files that a robot names.
#pragma once

#include "dynamics/model/robots/robot.hpp"
#include "dynamics/model/robots/xml.hpp"

namespace espalier::dynamics::model::robots {

/// Folder of a file, with a slash at its end; "" where its name has none.
[[nodiscard]] std::string folder_of(const std::string& file);
/// A path from a folder, unless it begins at the root.
[[nodiscard]] std::string path_from(const std::string& folder, const std::string& path);

/// A path of URDF: package://NAME/REST is looked for in the folder given for NAME, in those of ROS_PACKAGE_PATH, and in
/// the folders above the robot's; file:// and model:// likewise.
/// @throws Error(invalid_input) that names the file and the folders where it was not found
[[nodiscard]] std::string find_urdf_file(const Element& mesh, const std::string& name, const std::string& robot_folder,
                                         const RobotOptions& options);
/// Whether surfaces can be made of such a file: .stl, .obj.
[[nodiscard]] bool is_surface_file(const std::string& path);

}  // namespace espalier::dynamics::model::robots
