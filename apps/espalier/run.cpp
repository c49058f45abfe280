/// \file
/// `espalier run`: another program, whose solvers' libraries are ours (hosts/), and who solved what in the end.
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <sstream>

#include "command.hpp"
#include "common/terminal.hpp"

namespace espalier::cli {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void refuse(const std::string& message) { throw Error(StatusCode::invalid_input, message); }

/// The variable with `value` before what it holds already.
void prepend(const char* variable, const std::string& value, char separator) {
  const char* before = std::getenv(variable);
  const bool alone = before == nullptr || *before == '\0';
  ::setenv(variable, (alone ? value : value + separator + before).c_str(), 1);
}

/// A folder of its own for links and the log, gone in the end. Links to libraries stand in espalier/lib, as the
/// libraries do in a wheel: what a wheel brings in espalier.libs is looked for relative to the link (dlopen's $ORIGIN).
class RunFolder {
 public:
  RunFolder() {
    std::string name = (fs::temp_directory_path() / "espalier-run-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) refuse(fmt::format("{}: cannot be made: {}", name, std::strerror(errno)));
    path_ = name;
    fs::create_directories(links());
  }
  ~RunFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }
  [[nodiscard]] fs::path root() const { return path_ / "espalier"; }
  [[nodiscard]] fs::path links() const { return root() / "lib"; }

  /// A link of this name to the library, and one to what a wheel has brought with it.
  void link(const fs::path& library, const char* name) const {
    fs::create_symlink(library, links() / name);
    const fs::path brought = library.parent_path() / "../../espalier.libs";
    if (fs::exists(brought) && !fs::exists(path_ / "espalier.libs"))
      fs::create_symlink(fs::canonical(brought), path_ / "espalier.libs");
  }

 private:
  fs::path path_;
};

/// Beside this binary as it is built, in the library folder of the installation, or in the Python package (also for the
/// binary of espalier-cuda, which has no such libraries of its own); empty where it is in none.
fs::path find_host_library(const std::string& name) {
  const fs::path binary = fs::read_symlink("/proc/self/exe").parent_path();
  for (const fs::path& folder : {binary / "hosts", binary / ".." / "lib", binary / ".." / ESPALIER_LIBRARY_FOLDER,
                                 binary / ".." / ".." / "espalier" / "lib"}) {
    if (fs::exists(folder / name)) return fs::canonical(folder / name);
  }
  return {};
}

fs::path host_library(const std::string& name) {
  fs::path found = find_host_library(name);
  if (found.empty())
    refuse(
        fmt::format("{} is not there; build it: cmake --build build/release --target espalier_hosts (what it needs: "
                    "docs/guide/hosts.md; wheels for other machines have none for PETSc)",
                    name));
  return found;
}

/// Each way in: what a program looks for, and where it finds ours.
void offer_hsl(const RunFolder& folder) {
  folder.link(host_library("libespalier_hsl.so"), "libhsl.so");
  prepend("LD_LIBRARY_PATH", folder.links().string(), ':');
}

void offer_mkl(const RunFolder& folder) {
  const fs::path ours = host_library("libespalier_mkl_pardiso.so");
  folder.link(ours, "libmkl_rt.so");
  ::setenv("MKLROOT", folder.root().c_str(), 1);
  ::setenv("PYPARDISO_MKL_RT", ours.c_str(), 1);
  prepend("LD_PRELOAD", ours.string(), ':');
}

void offer_panua(const RunFolder& folder) {
  folder.link(host_library("libespalier_panua.so"), "libpardiso.so");
  ::setenv("PARDISO_PATH", folder.links().c_str(), 1);
  prepend("LD_LIBRARY_PATH", folder.links().string(), ':');
}

/// Functions that a program calls in a library of its own: ours stand before them.
void offer_before(const std::string& name) {
  prepend("LD_PRELOAD", host_library("libespalier_" + name + ".so").string(), ':');
}

/// For the solvers that are named neither by the program nor by the user's own options, which count.
void offer_petsc() {
  const std::string options = "-dll_append " + host_library("libespalier_petsc.so").string() +
                              " -pc_factor_mat_solver_type espalier -st_pc_factor_mat_solver_type espalier";
  prepend("PETSC_OPTIONS", options, ' ');
}

/// Those that a program which knows none of them does not notice, as far as they were built.
std::vector<std::string> usual_interfaces() {
  std::vector<std::string> names = {"hsl", "mkl", "panua", "umfpack"};
  for (const char* name : {"cholmod", "mumps"})  // need headers of others
    if (!find_host_library(fmt::format("libespalier_{}.so", name)).empty()) names.emplace_back(name);
  return names;
}

/// Factorizations of one interface.
struct Work {
  int count = 0, failed = 0;
  std::int64_t largest = 0;
  double seconds = 0;
};

/// From lines "espalier NAME: factorized n N, ..., S s[, ...][; what went wrong]".
std::map<std::string, Work> read_log(const fs::path& path) {
  std::map<std::string, Work> found;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string word, name, verb;
    char n = ' ';
    std::int64_t rows = 0;
    if (!(words >> word >> name >> verb >> n >> rows) || word != "espalier" || verb != "factorized") continue;
    name.pop_back();  // the colon
    Work& work = found[name];
    ++work.count;
    work.failed += line.find(';') != std::string::npos ? 1 : 0;
    work.largest = std::max(work.largest, rows);
    if (const std::size_t end = line.find(" s"); end != std::string::npos)
      work.seconds += std::strtod(line.c_str() + line.rfind(' ', end - 1), nullptr);
  }
  return found;
}

struct RunCommand {
  std::vector<std::string> as, words;
  std::string device;
  int threads = 0;

  int run() const;
  int start() const;
};

/// Runs the program with our streams and waits for its end. Ctrl-C is the program's affair.
int RunCommand::start() const {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t usual;  // main() ignores these; the program must not inherit that
  sigemptyset(&usual);
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGINT, SIGQUIT}) sigaddset(&usual, signal);
  posix_spawnattr_setsigdefault(&attributes, &usual);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGQUIT, SIG_IGN);
  pid_t process = 0;
  const int error = posix_spawnp(&process, arguments[0], nullptr, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) refuse(fmt::format("{}: {}", words.front(), std::strerror(error)));
  int status = 0;
  while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

int RunCommand::run() const {
  const RunFolder folder;
  std::vector<std::string> options;
  if (!device.empty()) options.push_back("device=" + device);
  if (threads > 0) options.push_back(fmt::format("threads={}", threads));
  // The command's words come later than the variable's, and count.
  const char* before = std::getenv("ESPALIER_OPTIONS");
  if (before != nullptr && *before != '\0') options.insert(options.begin(), before);
  if (!options.empty()) ::setenv("ESPALIER_OPTIONS", fmt::format("{}", fmt::join(options, ";")).c_str(), 1);
  const bool own_log = std::getenv("ESPALIER_LOG") != nullptr;
  const fs::path log = folder.path() / "log";
  if (!own_log) ::setenv("ESPALIER_LOG", log.c_str(), 1);
  std::set<std::string> offered;
  for (const std::string& name : as.empty() ? usual_interfaces() : as) {
    if (!offered.insert(name).second) continue;  // named twice
    if (name == "umfpack" || name == "cholmod" || name == "mumps") offer_before(name);
    if (name == "petsc") offer_petsc();
    if (name == "hsl") offer_hsl(folder);
    if (name == "mkl") offer_mkl(folder);
    if (name == "panua") offer_panua(folder);
  }
  const int code = start();
  if (own_log) return code;
  const auto found = read_log(log);
  if (found.empty()) print_hint("no solver of ours was asked for anything");
  for (const auto& [name, work] : found) {
    print_hint(fmt::format("{}: {} factorization{}{}, largest n {}, {:.3g} s", name, work.count,
                           work.count == 1 ? "" : "s", work.failed > 0 ? fmt::format(" ({} failed)", work.failed) : "",
                           work.largest, work.seconds));
  }
  return code;
}

}  // namespace

void add_run(CLI::App& app, Action& action) {
  auto command = std::make_shared<RunCommand>();
  CLI::App* sub = app.add_subcommand("run", "Run a program with our solver in place of those that it loads");
  sub->add_option("--as", command->as, "the interfaces that are offered (default: all but petsc)")
      ->delimiter(',')
      ->check(CLI::IsMember({"hsl", "mkl", "panua", "umfpack", "cholmod", "mumps", "petsc"}))
      ->type_name("hsl,mkl,panua,umfpack,cholmod,mumps,petsc");
  sub->add_option("--device", command->device, "where our solver works, as of solve")->type_name("DEVICE");
  sub->add_option("--threads", command->threads, "of our solver")->check(CLI::Range(1, 4096))->type_name("N");
  sub->add_option("program", command->words, "the program and its arguments, after --")
      ->required()
      ->type_name("PROGRAM ...");
  sub->positionals_at_end();
  sub->callback([command, &action] {
    action = [command] {
      try {
        return command->run();
      } catch (const fs::filesystem_error& error) {
        refuse(fmt::format("the folder of links for the program cannot be made: {}", error.what()));
      }
    };
  });
}

}  // namespace espalier::cli
