#include "dynamics/model/robots/files.hpp"

#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics::model::robots {
namespace {

namespace fs = std::filesystem;

bool is_file(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(path, none);
}

/// Where a package may be: its folder itself.
std::vector<fs::path> package_folders(const std::string& package, const std::string& robot_folder,
                                      const RobotOptions& options) {
  std::vector<fs::path> list;
  if (const auto it = options.packages.find(package); it != options.packages.end()) return {it->second};
  if (const char* paths = std::getenv("ROS_PACKAGE_PATH"); paths != nullptr) {
    std::string_view rest = paths;
    while (!rest.empty()) {
      const std::size_t colon = rest.find(':');
      const fs::path one = std::string(rest.substr(0, colon));
      if (one.filename() == package) list.push_back(one);
      list.push_back(one / package);
      rest = colon == std::string_view::npos ? std::string_view() : rest.substr(colon + 1);
    }
  }
  std::error_code none;
  fs::path above = fs::absolute(robot_folder.empty() ? "." : robot_folder, none).lexically_normal();
  if (!above.has_filename()) above = above.parent_path();
  for (;; above = above.parent_path()) {
    if (above.filename() == package) list.push_back(above);
    list.push_back(above / package);
    if (above == above.parent_path()) break;
  }
  return list;
}

}  // namespace

std::string folder_of(const std::string& file) {
  const std::size_t slash = file.rfind('/');
  return slash == std::string::npos ? "" : file.substr(0, slash + 1);
}

std::string path_from(const std::string& folder, const std::string& path) {
  if (folder.empty() || (!path.empty() && path.front() == '/')) return path;
  return folder.back() == '/' ? folder + path : folder + "/" + path;
}

std::string find_urdf_file(const Element& mesh, const std::string& name, const std::string& robot_folder,
                           const RobotOptions& options) {
  const std::size_t mark = name.find("://");
  const std::string scheme = mark == std::string::npos ? "" : name.substr(0, mark);
  if (scheme.empty() || scheme == "file") {
    std::string path = path_from(robot_folder, scheme.empty() ? name : name.substr(mark + 3));
    if (is_file(path)) return path;
    mesh.fail("there is no file '" + path + "'; without its shapes the robot is read by geometry = false (Python), " +
              "--no-geometry (espalier robot)");
  }
  if (scheme != "package" && scheme != "model")
    mesh.fail("'" + name + "' is neither a path nor package://NAME/PATH or file://PATH");
  const std::string path = name.substr(mark + 3);
  const std::size_t slash = path.find('/');
  const std::string package = path.substr(0, slash), rest = slash == std::string::npos ? "" : path.substr(slash + 1);
  const std::vector<fs::path> folders = package_folders(package, robot_folder, options);
  for (const fs::path& folder : folders)
    if (const fs::path file = folder / rest; is_file(file)) return file.string();
  mesh.fail("'" + name + "' was not found: the package '" + package + "' is looked for in packages = { \"" + package +
            "\": FOLDER } (Python), --package " + package + "=FOLDER, ROS_PACKAGE_PATH, and the folders above '" +
            (robot_folder.empty() ? "." : robot_folder) + "'; without shapes the robot is read by geometry = false, " +
            "--no-geometry");
}

bool is_surface_file(const std::string& path) {
  const std::string name = lower(path);
  return name.ends_with(".stl") || name.ends_with(".obj");
}

}  // namespace espalier::dynamics::model::robots
