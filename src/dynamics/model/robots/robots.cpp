#include "dynamics/model/robots/robots.hpp"

#include <utility>

#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/robots/mjcf.hpp"
#include "dynamics/model/robots/robot_writer.hpp"
#include "dynamics/model/robots/toml_writer.hpp"
#include "dynamics/model/robots/urdf.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {

bool is_robot_file(std::string_view path) {
  const std::string name = lower(path);
  return name.ends_with(".urdf") || name.ends_with(".xml") || name.ends_with(".mjcf") || name.ends_with(".xacro");
}

RobotText robot_as_model(std::string text, const std::string& path, const RobotOptions& options) {
  const XmlFile file(path, std::move(text));
  const std::string_view tag = file.root().name();
  if (tag != "robot" && tag != "mujoco")
    Element{file.root(), &file}.fail("is neither URDF, <robot>, nor MJCF, <mujoco>");
  Robot robot = tag == "robot" ? read_urdf(file, options) : read_mjcf(file, options);
  const RobotTree tree = make_tree(robot, options);
  if (tree.moving.empty())
    Element{file.root(), &file}.fail("nothing moves in it: no link has a joint (free_base = true lets a URDF go)");
  RobotText out;
  std::string model = written_model(robot, tree, path, options);
  std::string passed;
  for (const auto& [what, count] : robot.passed_over)
    passed += (passed.empty() ? "" : ", ") + std::to_string(count) + " " + what;
  if (!passed.empty()) robot.notices.insert(robot.notices.begin(), path + ": passed over: " + passed);
  std::string comments;
  for (const std::string& notice : robot.notices) comments += "# " + printable(notice) + "\n";
  out.text = comments + model;
  out.notices = std::move(robot.notices);
  return out;
}

}  // namespace espalier::dynamics::model::robots
