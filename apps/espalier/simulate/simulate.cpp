/// \file
/// `espalier simulate`: load a model, run it, report.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/progress.hpp"
#include "common/solver_flags.hpp"
#include "common/stop_signals.hpp"
#include "common/terminal.hpp"
#include "espalier/dynamics.hpp"
#include "mpi/launched_ranks.hpp"
#include "simulate/sensitivity_report.hpp"
#include "simulate/simulate_report.hpp"
#include "simulate/step_log.hpp"
#include "solve/report.hpp"

namespace espalier::cli {

namespace {

struct SimulateCommand {
  std::string model, report_file, trace_file;
  SimulationOptions options;
  double until = 0;
  bool until_given = false;
  SolverFlags flags;
  ProgressLines::Options progress_lines;
  bool json = false, quiet = false, verbose = false;
  std::vector<std::string> parameters;  // --derivative
  bool adjoint = false;
  RankOptions ranks;

  int run();
  int lead(LaunchedRanks& launched);
  int simulate();
  [[nodiscard]] std::optional<Error> write_trace(const Simulation& simulation) const;
  int differentiate();
};

void print_outcome(const SimulateCommand& command, const SimulationSummary& s) {
  if (!command.quiet) print_result("{}", simulate_summary(s));
  if (!s.status.ok()) {
    print_error(s.status.message);
    std::error_code gone;  // with its folder, perhaps
    for (const std::string& file : s.files)
      if (file.ends_with(".restart") && std::filesystem::exists(file, gone))
        print_hint(fmt::format("the last state is in '{}'", file));
  } else if (s.interrupted) {
    print_note("espalier: stopped at t = {:g}\n", s.t_end);
  } else if (!command.quiet) {
    print_result("\n{}\n", toned(Tone::good, "simulated"));
  }
}

std::optional<Error> SimulateCommand::write_trace(const Simulation& simulation) const {
  if (trace_file.empty()) return {};
  const Status status = simulation.write_trace(trace_file);
  if (status.ok()) return {};
  return Error(status);
}

/// What the ranks beside the first do.
int serve(LaunchedRanks& launched) {
  const StopSignals signals;  // the launcher tells all ranks; the first one decides when it stops
  Status status = serve_simulations(launched.ranks());
  std::int64_t code = 0;
  if (status.ok()) status = launched.on_all([&]() -> Status { return code = launched.from_first(0), Status{}; });
  if (status.ok()) return static_cast<int>(code);
  launched.leave_open();
  return exit_code(status.code);  // rank 0 speaks for all
}

/// Runs the command on rank 0 and ends with the others, however it ends.
int SimulateCommand::lead(LaunchedRanks& launched) {
  const auto end = [&](int code) {
    Status status = end_simulations(launched.ranks());
    if (status.ok()) status = launched.on_all([&]() -> Status { return (void)launched.from_first(code), Status{}; });
    if (!status.ok()) launched.leave_open();
  };
  options.ranks = launched.ranks();
  try {
    if (!parameters.empty())
      throw Error(StatusCode::invalid_input, "--derivative works in one process; start it without mpirun");
    const int code = simulate();
    end(code);
    return code;
  } catch (const Error& error) {
    end(exit_code(error.status().code));
    throw;
  } catch (const std::bad_alloc&) {
    end(kMemory);
    throw;
  } catch (...) {
    end(kInternalError);
    throw;
  }
}

int SimulateCommand::run() {
  LaunchedRanks launched(ranks);
  if (launched.ranks().size() > 1) return launched.first() ? lead(launched) : serve(launched);
  return parameters.empty() ? simulate() : differentiate();
}

int SimulateCommand::simulate() {
  if (until_given) options.until = until;
  static_cast<void>(flags.options());  // names a wrong value before anything is read
  const auto result = [this](const char* name) { return options.out.empty() ? "" : options.out + "/" + name; };
  const std::string csv = result("quantities.csv"), series = result("motion.pvd"), state = result("state.restart");
  const std::string frames = result("results.vtkhdf");
  const std::string page = options.page ? result("index.html") : "";
  check_outputs({{"the model", model},
                 {"--restart", options.restart},
                 {"quantities.csv of --out", csv},
                 {"motion.pvd of --out", series},
                 {"results.vtkhdf of --out", frames},
                 {"state.restart of --out", state},
                 {"index.html of --out", page}},
                {{"--report", report_file}, {"--trace", trace_file}});
  options.record_timeline = !trace_file.empty();
  for (const auto& [key, value] : flags.values()) options.solver.emplace_back(key, value);
  const bool heard = !quiet && !json;
  Progress progress(heard, "simulate", progress_lines);
  StepLog starting(heard, verbose, progress);
  StepLog* log_of_search = &starting;
  options.on_search = [&](const SimulationSearch& search) {
    log_of_search->search(search);
    return !stop_was_asked();
  };
  options.interrupted = [] { return stop_was_asked(); };
  Simulation simulation(options);
  progress.begin("model");
  Status status = simulation.load(model);
  const bool loaded = status.ok();
  if (loaded) {
    progress.end(simulate_headline(simulation.summary()));
    const StopSignals signals;
    StepLog log(heard, verbose, progress);
    if (heard) progress.follow("");
    log_of_search = &log;
    status = simulation.run([&log](const SimulationStep& step) {
      log.add(step);
      return !stop_was_asked();
    });
    log.close();
  }
  progress.abandon();
  const SimulationSummary& summary = simulation.summary();
  const int code = status.ok() && summary.interrupted ? kInterrupted : exit_code(status.code);
  const auto report = to_json(summary, model, code);
  // A run that is restarted at its end moves nothing, and writes what a kill kept from being written.
  const bool ran = !options.out.empty() && (status.ok() || summary.t_end > summary.t_begin);
  const std::optional<Error> unwritten[] = {write_report(report_file, report),
                                            loaded ? write_trace(simulation) : std::nullopt,
                                            write_report(ran ? options.out + "/summary.json" : "", report)};
  if (json) {
    print_result("{}\n", to_text(report));
    if (!status.ok()) print_error(status.message);
  } else {
    print_outcome(*this, summary);
  }
  for (const auto& error : unwritten)
    if (error) throw Error(*error);
  return code;
}

std::vector<SensitivityParameter> parameters_of(const std::vector<std::string>& given) {
  std::vector<SensitivityParameter> list;
  for (const std::string& text : given) {
    const std::size_t colon = text.find(':');
    list.push_back({text.substr(0, colon), 0});
    if (colon == std::string::npos) continue;
    char* end = nullptr;
    list.back().step = std::strtod(text.c_str() + colon + 1, &end);
    if (*end != 0 || !(list.back().step > 0))
      throw Error(StatusCode::invalid_input,
                  fmt::format("--derivative {}: behind the colon stands a step greater than 0", text));
  }
  return list;
}

int SimulateCommand::differentiate() {
  if (json || !report_file.empty() || !trace_file.empty())
    throw Error(StatusCode::invalid_input, "--derivative: --json, --report and --trace do not go with it");
  if (until_given) options.until = until;
  static_cast<void>(flags.options());
  for (const auto& [key, value] : flags.values()) options.solver.emplace_back(key, value);
  const std::string csv = options.out.empty() ? "" : options.out + "/derivatives.csv";
  check_outputs({{"the model", model}, {"derivatives.csv of --out", csv}}, {{"--report", report_file}});
  const StopSignals signals;
  options.interrupted = [] { return stop_was_asked(); };
  Progress progress(!quiet, "simulate", progress_lines);
  if (!quiet) progress.follow("");
  const SensitivityResult r = sensitivities(model, parameters_of(parameters), options,
                                            adjoint ? SensitivityMethod::adjoint : SensitivityMethod::automatic);
  progress.abandon();
  if (!r.status.ok()) {
    print_error(r.status.message);
    return exit_code(r.status.code);
  }
  if (!quiet) print_result("{}", sensitivity_summary(r));
  for (const std::string& notice : r.summary.notices) print_note("espalier: notice: {}\n", notice);
  if (r.summary.interrupted) print_note("espalier: stopped at t = {:g}\n", r.summary.t_end);
  if (!csv.empty()) {
    base::OutputFile file(csv);
    file.write(sensitivity_csv(r));
    file.commit();
    if (!quiet) print_result("wrote {}\n", csv);
  }
  return r.summary.interrupted ? kInterrupted : exit_code(r.status.code);
}

}  // namespace

void add_simulate(CLI::App& app, Action& action) {
  auto command = std::make_shared<SimulateCommand>();
  SimulationOptions& o = command->options;
  CLI::App* sub = app.add_subcommand("simulate", "Simulate a mechanical system (docs/guide/simulate.md)");
  add_file(*sub, "model", command->model, "the model, TOML, or a robot, .urdf, .xml (docs/guide/robots.md)")
      ->required();
  add_file(*sub, "--out", o.out, "folder for results: a page to look at, CSV, ParaView, restart file, summary.json",
           "DIR");
  sub->add_option("--set", o.set, "replace a value of the model, for instance parameters.size=2; may be repeated")
      ->type_name("PATH=VALUE")
      ->take_all()
      ->allow_extra_args(false);
  sub->add_option("--until", command->until, "end there instead of at integrator.end")
      ->type_name("TIME")
      ->check(number())
      ->each([command = command.get()](const std::string&) { command->until_given = true; });
  sub->add_flag_callback(
      "--no-page", [command = command.get()] { command->options.page = false; },
      "write no index.html, the page that shows the run (espalier view DIR)");
  add_file(*sub, "--restart", o.restart, "go on from this restart file");
  sub->add_flag("--accept-changes", o.accept_changes,
                "go on although the model differs from that of the restart file; the notices say what differs");
  add_file(*sub, "--dump-matrices", o.dump, "write Newton matrices with right-hand sides into this folder", "DIR");
  sub->add_option("--dump-every", o.dump_every, "of the factorizations, every N-th (default 1)")
      ->type_name("N")
      ->check(CLI::Range(1L, 1000000000L));
  sub->add_option("--dump-count", o.dump_count, "and at most so many (default 10)")
      ->type_name("K")
      ->check(CLI::Range(1L, 1000000L));
  add_file(*sub, "--report", command->report_file, "write the summary as JSON here");
  add_file(*sub, "--trace", command->trace_file, "write what each step does when, for ui.perfetto.dev");
  sub->add_flag("--json", command->json, "print the summary as JSON instead of text");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  sub->add_flag("-v,--verbose", command->verbose, "a line for every step");
  CLI::Option* derivative =
      sub->add_option(
             "--derivative", command->parameters,
             "differentiate the quantities by this number of the model, for instance parameters.size, and print "
             "that alone; may be repeated (docs/use/sensitivities.md)")
          ->type_name("PATH[:STEP]")
          ->take_all()
          ->allow_extra_args(false);
  sub->add_flag("--adjoint", command->adjoint,
                "with --derivative: the adjoint method, whose time hardly grows with the number of parameters; of a "
                "motion at its end alone")
      ->needs(derivative);
  command->ranks.add_to(*sub);
  command->progress_lines.add_to(*sub);
  command->flags.add_to(*sub);
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
