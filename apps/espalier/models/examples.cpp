/// \file
/// `espalier examples`: the models that come with this binary: their names, where one is, copies to change.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/terminal.hpp"
#include "dynamics/model/read/value.hpp"

namespace espalier::cli {

namespace fs = std::filesystem;

namespace {

/// By name. In the Python package, the installation or the bundle in one folder; in the source folder of this build in
/// two.
std::map<std::string, fs::path> example_files() {
  const fs::path binary = fs::read_symlink("/proc/self/exe").parent_path();
  std::vector<fs::path> folders = {binary / "../../models", binary / "../../examples"};
  for (const char* one : {"../models", "../../espalier/models", "../share/espalier/models"}) {
    if (fs::exists(binary / one / "engine.toml")) folders = {binary / one};
  }
  std::map<std::string, fs::path> found;
  for (const fs::path& folder : folders) {
    std::error_code absent;
    for (const fs::directory_entry& file : fs::directory_iterator(folder, absent))
      if (file.path().extension() == ".toml") found[file.path().stem().string()] = fs::canonical(file.path());
  }
  if (found.empty()) throw Error(StatusCode::invalid_input, "the models that belong to this binary are not beside it");
  return found;
}

/// What the comment at its head says first, up to the end of that line or clause.
std::string what_it_is(const fs::path& file) {
  std::ifstream text(file);
  for (std::string line; std::getline(text, line);) {
    const std::size_t hash = line.find("# ");
    if (hash == std::string::npos) continue;
    const std::string words = line.substr(hash + 2);
    return words.substr(0, std::min(words.find(". "), words.find_last_not_of(".: ") + 1));
  }
  return {};
}

void copy_to(const fs::path& folder, const fs::path& file) {
  std::error_code error;
  const fs::path copy = folder / file.filename();
  fs::create_directories(folder, error);
  if (!error) fs::copy_file(file, copy, error);
  if (error) {
    const bool there = error == std::errc::file_exists;
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: {}", copy.string(), there ? "is there already and is not replaced" : error.message()));
  }
  print_result("{}\n", copy.string());
}

int run_examples(const std::string& name, const std::string& folder) {
  std::map<std::string, fs::path> files = example_files();
  if (!name.empty() && files.count(name) == 0) {
    std::vector<std::string> names;
    for (const auto& [known, file] : files) names.push_back(known);
    throw Error(StatusCode::invalid_input,
                fmt::format("there is no example '{}'{}", name, dynamics::model::suggestion(name, names)));
  }
  Table table("<<");
  for (const auto& [known, file] : files) {
    if (!name.empty() && known != name) continue;
    if (!folder.empty()) {
      copy_to(folder, file);
    } else if (!name.empty()) {
      print_result("{}\n", file.string());
    } else {
      table.add({known, what_it_is(file)});
    }
  }
  if (name.empty() && folder.empty())
    print_result("{}\nespalier examples engine --copy .   puts engine.toml here; without --copy: says where it is\n",
                 table.text());
  return kSolved;
}

}  // namespace

void add_examples(CLI::App& app, Action& action) {
  auto name = std::make_shared<std::string>(), folder = std::make_shared<std::string>();
  CLI::App* sub = app.add_subcommand("examples", "The models that come along: list them, find one, copy them");
  sub->add_option("name", *name, "one of them: where it is (default: list all)")->type_name("NAME");
  add_file(*sub, "--copy", *folder, "copy it, or all of them, into this folder", "DIR");
  sub->callback([name, folder, &action] { action = [name, folder] { return run_examples(*name, *folder); }; });
}

}  // namespace espalier::cli
