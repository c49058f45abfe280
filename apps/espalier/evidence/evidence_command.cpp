/// \file
/// `espalier evidence`: the figures of the pages against their results; scripts/figures.py of the source folder does
/// it.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "command.hpp"

namespace espalier::cli {

namespace {

namespace fs = std::filesystem;

struct EvidenceCommand {
  bool list = false, verify = false;
  std::string share, seed, seconds, only, folder;

  int run() const;
};

/// The source folder: the one that was named, the current one, or the one that this binary was built in.
fs::path source_folder(const std::string& named) {
  const fs::path binary = fs::read_symlink("/proc/self/exe").parent_path();
  const std::vector<fs::path> places =
      named.empty() ? std::vector<fs::path>{fs::current_path(), binary / "../.."} : std::vector<fs::path>{named};
  for (const fs::path& place : places)
    if (fs::exists(place / "scripts/figures.py")) return fs::canonical(place);
  throw Error(StatusCode::invalid_input,
              fmt::format("{}: no scripts/figures.py there; --source names a source folder", places.front().string()));
}

int EvidenceCommand::run() const {
  std::vector<std::string> words = {"python3", (source_folder(folder) / "scripts/figures.py").string(), "--binary",
                                    fs::read_symlink("/proc/self/exe").string()};
  if (list) words.emplace_back("--list");
  if (verify) words.emplace_back("--verify");
  for (const auto& [name, value] : {std::pair("--share", share), std::pair("--seed", seed),
                                    std::pair("--seconds", seconds), std::pair("--only", only)})
    if (!value.empty()) words.insert(words.end(), {name, value});
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  ::execvp(pointers[0], pointers.data());
  throw Error(StatusCode::invalid_input, fmt::format("python3 cannot be started: {}", std::strerror(errno)));
}

}  // namespace

void add_evidence(CLI::App& app, Action& action) {
  auto command = std::make_shared<EvidenceCommand>();
  CLI::App* sub =
      app.add_subcommand("evidence", "Hold the figures of the pages against their results; make some again");
  sub->add_flag("--list", command->list, "where each figure comes from: command, machine, date, versions");
  sub->add_flag("--verify", command->verify,
                "make a share of the ratios and counts again, and name what has moved by 5 %");
  sub->add_option("--share", command->share, "share of those that this machine can make (default: 0.1)");
  sub->add_option("--seed", command->seed, "which of them (default: 1)");
  sub->add_option("--seconds", command->seconds, "none goes on after (default: 600)");
  sub->add_option("--only", command->only, "ratio or count: these alone")->check(CLI::IsMember({"ratio", "count"}));
  sub->add_option("--source", command->folder, "source folder (default: the current one, or that of the build)");
  sub->footer("Ends with 0, with 1 where a page is not what its results say, with 6 where a figure has moved.");
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
