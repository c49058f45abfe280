/// \file
/// What every subcommand is made of: how it joins the command line and how it ends.
#pragma once

#include <functional>

#include "espalier/types.hpp"

namespace CLI {
class App;
}

namespace espalier::cli {

/// Exit codes, documented in docs/guide/command_line.md.
enum ExitCode : int {
  kSolved = 0,
  kInternalError = 1,  ///< a bug of ours
  kBadInput = 2,       ///< wrong usage, unreadable input
  kSingular = 3,       ///< singular, or not positive definite for llt
  kMemory = 4,
  kDevice = 5,
  kAccuracy = 6,       ///< backward error above what was asked for; Newton or the step size control gave up
  kInterrupted = 130,  ///< Ctrl-C, SIGTERM: stopped cleanly; results and restart file of a simulation are written
};

/// The exit code for a status of the library.
int exit_code(StatusCode code);

/// What main() runs once the command line is understood; returns the exit code.
using Action = std::function<int()>;

/// Adds the subcommands that this binary has (commands.cpp; first/commands.cpp of the one that ./run builds first).
void add_commands(CLI::App& app, int argc, const char* const* argv, Action& action);

/// Each adds its subcommand to `app`; `action` is set when the user chose it.
void add_solve(CLI::App& app, Action& action);
void add_analyze(CLI::App& app, Action& action);
void add_modes(CLI::App& app, Action& action);
void add_harmonic(CLI::App& app, Action& action);
void add_condense(CLI::App& app, Action& action);
void add_inverse(CLI::App& app, Action& action);
void add_simulate(CLI::App& app, Action& action);
void add_export_fmu(CLI::App& app, Action& action);
void add_view(CLI::App& app, Action& action);
void add_mesh(CLI::App& app, Action& action);
void add_reduce(CLI::App& app, Action& action);
void add_robot(CLI::App& app, Action& action);
void add_generate(CLI::App& app, Action& action);
/// argc and argv: for the record of what was asked. In a build without benchmarks (absent/bench.cpp) it,
/// add_report() and add_evidence() say how to get them.
void add_bench(CLI::App& app, int argc, const char* const* argv, Action& action);
void add_report(CLI::App& app, Action& action);
void add_evidence(CLI::App& app, Action& action);
void add_fetch_matrix(CLI::App& app, Action& action);
void add_info(CLI::App& app, Action& action);
void add_examples(CLI::App& app, Action& action);
void add_run(CLI::App& app, Action& action);
void add_mpi_adapter(CLI::App& app, Action& action);

}  // namespace espalier::cli
