/// \file
/// `espalier view`: the page of a run, or of a model that has not run yet, in a browser.
#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <thread>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/terminal.hpp"
#include "espalier/dynamics.hpp"

extern char** environ;

namespace espalier::cli {

namespace fs = std::filesystem;

namespace {

/// file:// and the absolute path, in the letters that an address may have.
std::string address_of(const fs::path& file) {
  std::string address = "file://";
  for (const char c : fs::canonical(file).string()) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       std::string_view("/-._~").find(c) != std::string_view::npos;
    address += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return address;
}

/// Starts a program that may go on when we have ended. @return whether it is there and did not fail at once
bool start_program(const std::string& program, const std::string& argument) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  for (const int stream : {0, 1, 2})
    posix_spawn_file_actions_addopen(&files, stream, "/dev/null", stream == 0 ? O_RDONLY : O_WRONLY, 0);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID);
  std::string name = program, address = argument;
  char* words[] = {name.data(), address.data(), nullptr};
  pid_t child = 0;
  const int failure = ::posix_spawnp(&child, name.c_str(), &files, &attributes, words, environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  if (failure != 0) return false;
  for (int k = 0; k < 20; ++k) {  // one that opens a window in a browser that runs ends soon
    int state = 0;
    if (::waitpid(child, &state, WNOHANG) == child) return WIFEXITED(state) && WEXITSTATUS(state) == 0;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return true;
}

bool open_in_browser(const std::string& address) {
  if (const char* own = std::getenv("BROWSER"); own != nullptr && *own != '\0') {
    const std::string list = own;  // names with colons between them
    for (std::size_t from = 0; from <= list.size();) {
      const std::size_t to = std::min(list.find(':', from), list.size());
      if (to > from && start_program(list.substr(from, to - from), address)) return true;
      from = to + 1;
    }
  }
  return start_program("xdg-open", address);
}

/// The page of a model before it runs, as a file that stays.
fs::path page_of_model(const std::string& model) {
  SimulationOptions options;
  options.page = false;
  Simulation simulation(options);
  if (const Status status = simulation.load(model); !status.ok()) {
    options.set = {"integrator.end=1"};  // a model in the making may not say yet what is to be run
    simulation = Simulation(options);
    if (!simulation.load(model).ok()) throw Error(status);
  }
  fs::path file =
      fs::temp_directory_path() / fmt::format("espalier-{}-{}.html", fs::path(model).stem().string(), ::getuid());
  base::OutputFile out(file.string());
  out.write(simulation.page());
  out.commit();
  return file;
}

fs::path page_of(const std::string& what) {
  std::error_code gone;
  if (fs::path(what).extension() == ".toml" && fs::is_regular_file(what, gone)) return page_of_model(what);
  fs::path page = fs::is_directory(what, gone) ? fs::path(what) / "index.html" : fs::path(what);
  if (fs::is_regular_file(page, gone)) {
    const std::string ending = page.extension().string();
    if (ending == ".html" || ending == ".htm") return page;
    throw Error(
        StatusCode::invalid_input,
        fmt::format("'{}' is no page (.html) and no model (.toml); `espalier mesh FILE --page DIR` makes a page of "
                    "a mesh",
                    page.string()));
  }
  throw Error(StatusCode::invalid_input,
              fmt::format("there is no page '{}'; `espalier simulate MODEL --out DIR` writes DIR/index.html (but for "
                          "--no-page, and [output] page = false)",
                          page.string()));
}

struct ViewCommand {
  std::string what;
  bool no_browser = false;
  [[nodiscard]] int run() const {
    const std::string address = address_of(page_of(what));
    print_result("{}\n", address);
    if (!no_browser && !open_in_browser(address))
      print_note("espalier: no browser could be started ($BROWSER, xdg-open); open the address above in one\n");
    return kSolved;
  }
};

}  // namespace

void add_view(CLI::App& app, Action& action) {
  auto command = std::make_shared<ViewCommand>();
  CLI::App* sub = app.add_subcommand("view", "Show a run in a browser, also while it goes on (docs/guide/see.md)");
  add_file(*sub, "what", command->what, "the folder of a run, its page, or a model (.toml) that has not run yet", "DIR")
      ->required();
  sub->add_flag("--no-browser", command->no_browser, "print the address of the page alone");
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
