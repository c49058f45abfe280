/// \file
/// `espalier analyze`: ordering and plan only; what the factorization would take; the tree by tier.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/memory.hpp"
#include "base/scratch_file.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/input.hpp"
#include "common/progress.hpp"
#include "common/solver_flags.hpp"
#include "common/stop_signals.hpp"
#include "common/terminal.hpp"
#include "solve/summary.hpp"

namespace espalier::cli {

namespace {

struct AnalyzeCommand {
  MatrixSource source;
  SolverFlags flags;
  std::string save_file, report_file;
  ProgressLines::Options progress_lines;
  bool json = false, quiet = false, dry_run = false;

  int run() const;
};

using Tiers = std::vector<Solver::TierRow>;

template <class AnySolver, class Matrix>
Tiers analyze(const AnalyzeCommand& command, AnySolver solver, const Matrix& matrix, RunRecord& record,
              Progress& progress) {
  progress.begin("analysis");
  record.analysis = solver.analyze(matrix);
  record.status = record.analysis->status;
  if (!record.status.ok()) return {};
  progress.end(duration(record.analysis->seconds));
  if (!command.save_file.empty()) record.status = solver.save_analysis(command.save_file);
  return solver.tiers();
}

Tiers fill_record(const AnalyzeCommand& command, const Options& options, RunRecord& record) {
  Progress progress(!command.quiet && !command.json, "analyze", command.progress_lines);
  base::ThreadPool pool(options.threads > 0 ? options.threads : base::available_cores());
  progress.begin("reading");
  const matrix::AnyMatrix any = command.source.load(record, pool);
  progress.end(duration(record.read_seconds));
  if (record.complex)
    return analyze(command, ComplexSolver(options), std::get<ComplexSparseMatrix>(any), record, progress);
  return analyze(command, Solver(options), std::get<SparseMatrix>(any), record, progress);
}

/// A dry run answers "would it fit?": with a budget on the host that is too small it ends like the factorization would.
Status check_budget(const AnalysisResult& analysis, Offset budget, const std::string& scratch) {
  if (analysis.predicted_disk_bytes > 0) {
    const Offset free = base::free_disk_bytes(scratch);
    if (analysis.predicted_disk_bytes <= free) return {};
    return {StatusCode::out_of_memory,
            fmt::format("the factorization needs {} in {}, {} are free there; make room, or raise --host-memory",
                        base::format_bytes(analysis.predicted_disk_bytes), scratch, base::format_bytes(free)),
            -1};
  }
  if (budget == 0 || analysis.predicted_bytes <= budget) return {};
  return {StatusCode::out_of_memory,
          fmt::format("the factorization needs {} on the host, --host-memory allows {}",
                      base::format_bytes(analysis.predicted_bytes), base::format_bytes(budget)),
          -1};
}

int AnalyzeCommand::run() const {
  Options options = flags.options();
  // Who reads along wants the last line, also where the command is stopped.
  std::optional<StopSignals> signals;
  if (progress_lines.wanted()) {
    options.interrupted = stop_was_asked;
    signals.emplace();
  }
  check_outputs({{"the matrix", source.file()}}, {{"--save", save_file}, {"--report", report_file}});
  RunRecord record;
  record.precision = options.precision;
  Tiers tiers;
  try {
    tiers = fill_record(*this, options, record);
  } catch (const Error& error) {
    record.status = error.status();
  }
  const Offset budget = options.host_memory_bytes;
  const bool analyzed = record.analysis && record.analysis->status.ok();
  if (analyzed && dry_run && record.status.ok())
    record.status = check_budget(*record.analysis, budget, options.scratch);
  std::optional<base::DiskRates> disk;
  if (analyzed && dry_run && record.status.ok() && record.analysis->predicted_disk_bytes > 0)
    disk = base::measure_disk(options.scratch);
  auto report = to_json(record);
  report["tree"] = to_json(tiers);
  report["disk"] = disk ? disk_forecast(*record.analysis, *disk) : nlohmann::ordered_json(nullptr);
  const std::optional<Error> unwritten = write_report(report_file, report);
  if (json) {
    print_result("{}\n", to_text(report));
  } else if (analyzed && !quiet) {
    print_result("{}", analysis_summary(record, tiers));
    if (dry_run) print_result("\n{}", forecast_summary(*record.analysis, budget, disk));
  }
  if (!record.status.ok()) print_error(record.status.message);
  if (unwritten) throw Error(*unwritten);
  return exit_code(record.status.code);
}

}  // namespace

void add_analyze(CLI::App& app, Action& action) {
  auto command = std::make_shared<AnalyzeCommand>();
  CLI::App* sub = app.add_subcommand("analyze", "Order the matrix and show the tree; nothing is factorized");
  command->source.add_to(*sub);
  sub->add_flag("--dry-run", command->dry_run, "also say what the factorization would take: work, time, memory");
  add_file(*sub, "--save", command->save_file, "save the analysis for `solve --analysis`");
  add_file(*sub, "--report", command->report_file, "write the report as JSON here");
  sub->add_flag("--json", command->json, "print the report as JSON instead of the tables");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  command->progress_lines.add_to(*sub);
  command->flags.add_to(*sub);
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
