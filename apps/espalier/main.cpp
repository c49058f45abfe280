/// \file
/// The command line `espalier`: reads the arguments, runs one subcommand, turns every failure into a message on stderr
/// and an exit code.
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <sstream>
#include <string_view>
#include <system_error>

#include "command.hpp"
#include "common/progress_lines.hpp"
#include "common/terminal.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {

namespace {

constexpr const char* kFooter =
    "Try:\n"
    "  espalier solve --generate \"elasticity 20 20 20\"   a generated mechanical system\n"
    "  espalier solve A.mtx --rhs b.mtx --out x.mtx      your own (Matrix Market, Rutherford-Boeing)\n"
    "  espalier simulate models/engine.toml              a flexible slider-crank engine\n"
    "  espalier COMMAND --help                           all options of a command\n"
    "\n"
    "Exit codes: 0 solved, 2 wrong usage or unreadable input, 3 singular or not positive definite, 4 memory,\n"
    "5 device, 6 accuracy not reached, 130 stopped by Ctrl-C or SIGTERM.";

/// A full disk or a closed pipe must not look like success.
int flush_output(int code) {
  const int error = output_error();
  if (error == 0) return code;
  print_error(fmt::format("cannot write to standard output: {}", std::strerror(error)));
  return code == kSolved ? kBadInput : code;
}

/// A file that is cut short while it is mapped into memory, or whose disk fails, is met as a signal. Nothing but the
/// end of the process is safe then.
extern "C" void end_for_lost_input(int) {
  constexpr std::string_view kText = "espalier: error: a file became shorter while it was read, or its disk failed\n";
  [[maybe_unused]] const auto written = ::write(STDERR_FILENO, kText.data(), kText.size());
  ::_exit(kBadInput);
}

/// Where no string can be made for a message any more.
int end_for_memory() {
  constexpr std::string_view kText = "espalier: error: the machine's memory is too small for this\n";
  [[maybe_unused]] const auto written = ::write(STDERR_FILENO, kText.data(), kText.size());
  return kMemory;
}

std::terminate_handler usual_end = nullptr;

/// nlohmann's json takes memory in its destructors: what it does not get ends the program here.
[[noreturn]] void end_terminated() {
  try {
    if (const std::exception_ptr error = std::current_exception()) std::rethrow_exception(error);
  } catch (const std::bad_alloc&) {
    ::_exit(end_for_memory());
  } catch (...) {  // a bug of ours
  }
  usual_end();
  std::abort();
}

/// A reader that goes away, or a limit on the size of files, is an error of one write, not the end of the process. And
/// a standard stream that is closed must not leave its number to the next file that is opened: what is printed would go
/// there. Reading from what takes its place ends at once, writing to it fails (to stderr: is not noticed).
void prepare_streams() {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGBUS, end_for_lost_input);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(stream, F_GETFD) < 0)
      static_cast<void>(::open("/dev/null", stream == STDERR_FILENO ? O_WRONLY : O_RDONLY));
}

/// Wrong usage: what CLI11 found, in one line, and where help is. --help and --version come here too.
int report_usage(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() == 0) {
    std::ostringstream text;
    app.exit(error, text, text);
    print_result("{}", text.str());
    return flush_output(kSolved);
  }
  const CLI::App* command = &app;
  std::string name = app.get_name();
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().front();
    name += " " + command->get_name();
  }
  const std::vector<std::string> words = app.remaining(true);
  const bool unknown =
      error.get_name() == "RequiredError" && command->get_require_subcommand_min() > 0 && !words.empty();
  // Its value was taken for the next argument, and CLI11 complains about that.
  const auto option = std::ranges::find_if(words, [](const std::string& word) { return word.starts_with('-'); });
  if (unknown)
    print_error(fmt::format("there is no command '{} {}'", name, words.front()));
  else if (option != words.end())
    print_error(fmt::format("'{}' has no option {}", name, *option));
  else
    print_error(error.what());
  print_hint(fmt::format("see '{} --help'", name));
  return kBadInput;
}

/// Runs the chosen action; nothing escapes.
int run_guarded(const Action& action) {
  try {
    return flush_output(action());
  } catch (const Error& error) {
    print_error(error.what());
    return exit_code(error.status().code);
  } catch (const std::bad_alloc&) {
    print_error("the machine's memory is too small for this; use a smaller system or more memory");
    return kMemory;
  } catch (const std::exception& error) {
    const auto* system = dynamic_cast<const std::system_error*>(&error);
    if (system != nullptr && system->code() == std::errc::resource_unavailable_try_again) {
      print_error(
          "the system refuses to start another thread; ask for fewer (--threads) or raise the limit (ulimit -u)");
      return kMemory;
    }
    print_error(fmt::format("internal error: {}", error.what()));
    print_hint("this is a bug of ours; please report it with the command and `espalier info --json`");
    return kInternalError;
  }
}

int run(int argc, char** argv) {
  CLI::App app{"espalier: a sparse direct solver for mechanics, and a simulator", "espalier"};
  Action action;
  app.set_version_flag("--version", std::string("espalier ") + solver::version());
  app.require_subcommand(1);
  app.footer(kFooter);
  add_commands(app, argc, argv, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return report_usage(app, error);
  }
  const int code = run_guarded(action);
  ProgressLines::of_program().finish(code, last_error());
  return code;
}

}  // namespace

}  // namespace espalier::cli

int main(int argc, char** argv) {
  espalier::cli::usual_end = std::set_terminate(espalier::cli::end_terminated);
  try {
    espalier::cli::prepare_streams();
    return espalier::cli::run(argc, argv);
  } catch (const std::bad_alloc&) {
    return espalier::cli::end_for_memory();
  } catch (...) {  // only what fails while the command line itself is set up
    return espalier::cli::kInternalError;
  }
}
