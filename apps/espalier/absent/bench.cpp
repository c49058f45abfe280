// `espalier bench`, `report` and `evidence` of a build without benchmarks (ESPALIER_EVIDENCE=OFF): how to get them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "command.hpp"

namespace espalier::cli {

namespace {

void add_absent(CLI::App& app, const char* name, const char* description, Action& action) {
  const std::string how = fmt::format(
      "this build has no benchmarks; in the source folder, `./run {} ...` builds them first (or configure with "
      "-DESPALIER_EVIDENCE=ON)",
      name);
  CLI::App* sub = app.add_subcommand(name, description);
  sub->footer(how);
  sub->prefix_command();  // whatever words and options follow
  sub->callback([how, &action] { action = [how]() -> int { throw Error(StatusCode::invalid_input, how); }; });
}

}  // namespace

void add_bench(CLI::App& app, int /*argc*/, const char* const* /*argv*/, Action& action) {
  add_absent(app, "bench", "Measure: rivals, sweeps, scaling, growth, ceilings (not in this build: `./run bench`)",
             action);
}

void add_report(CLI::App& app, Action& action) {
  add_absent(app, "report",
             "Make a page or Markdown tables of results of `espalier bench` (not in this build: `./run report`)",
             action);
}

void add_evidence(CLI::App& app, Action& action) {
  add_absent(app, "evidence",
             "Hold the figures of the pages against their results (not in this build: `./run evidence`)", action);
}

}  // namespace espalier::cli
