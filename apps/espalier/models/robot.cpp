/// \file
/// `espalier robot`: a robot of another program as a model, to edit.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/terminal.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/robots/robots.hpp"

namespace espalier::cli {

namespace {

using dynamics::model::robots::RobotOptions;

struct RobotCommand {
  std::string file, out;
  std::vector<std::string> positions, velocities, packages;
  RobotOptions options;
  bool no_geometry = false;
  int run();
};

/// NAME=VALUE
std::pair<std::string, std::string> pair_of(const std::string& text, const char* option) {
  const std::size_t at = text.find('=');
  if (at == std::string::npos || at == 0 || at + 1 == text.size())
    throw Error(StatusCode::invalid_input, fmt::format("{} {}: must be NAME=VALUE", option, text));
  return {text.substr(0, at), text.substr(at + 1)};
}

std::map<std::string, double> numbers_of(const std::vector<std::string>& given, const char* option) {
  std::map<std::string, double> out;
  for (const std::string& text : given) {
    const auto [name, value] = pair_of(text, option);
    char* end = nullptr;
    out[name] = std::strtod(value.c_str(), &end);
    if (*end != 0) throw Error(StatusCode::invalid_input, fmt::format("{} {}: '{}' is no number", option, text, value));
  }
  return out;
}

int RobotCommand::run() {
  options.geometry = !no_geometry;
  options.absolute_paths = !out.empty();
  options.positions = numbers_of(positions, "--position");
  options.velocities = numbers_of(velocities, "--velocity");
  for (const std::string& text : packages) options.packages.insert(pair_of(text, "--package"));
  if (!out.empty() && std::filesystem::exists(out))
    throw Error(StatusCode::invalid_input, fmt::format("'{}' is there already; name another file", out));
  const auto robot = dynamics::model::robots::robot_as_model(dynamics::read_whole_file(file), file, options);
  for (const std::string& notice : robot.notices) print_note("espalier: notice: {}\n", notice);
  if (out.empty()) {
    print_result("{}", robot.text);
    return kSolved;
  }
  base::OutputFile written(out);
  written.write(robot.text);
  written.commit();
  print_result("wrote {}; run it: espalier simulate {} --out results\n", out, out);
  return kSolved;
}

}  // namespace

void add_robot(CLI::App& app, Action& action) {
  auto command = std::make_shared<RobotCommand>();
  CLI::App* sub = app.add_subcommand("robot", "A robot, URDF or MJCF, as a model to edit (docs/guide/robots.md)");
  add_file(*sub, "file", command->file, "the robot: .urdf, .xml")->required();
  add_file(*sub, "--out", command->out, "write the model here instead of to stdout");
  sub->add_option("--keyframe", command->options.keyframe, "MJCF: begin with this keyframe, by name or number")
      ->type_name("NAME");
  sub->add_flag("--free-base", command->options.free_base, "URDF: the root is let go instead of held");
  sub->add_flag("--no-geometry", command->no_geometry, "read no shapes, and make no contacts");
  const auto list = [&](const char* name, std::vector<std::string>& values, const char* what, const char* type) {
    sub->add_option(name, values, what)->type_name(type)->take_all()->allow_extra_args(false);
  };
  list("--position", command->positions, "coordinate of a joint at the start; may be repeated", "NAME=VALUE");
  list("--velocity", command->velocities, "its rate at the start; may be repeated", "NAME=VALUE");
  list("--package", command->packages, "URDF: folder of package://NAME; may be repeated", "NAME=FOLDER");
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
