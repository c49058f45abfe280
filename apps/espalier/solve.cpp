/// \file
/// `espalier solve`: analyze, factorize, solve, report.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "checked_options.hpp"
#include "command.hpp"
#include "input.hpp"
#include "solver_flags.hpp"
#include "summary.hpp"
#include "terminal.hpp"

namespace espalier::cli {

namespace {

struct SolveCommand {
  MatrixSource source;
  SolverFlags flags;
  std::string rhs_file, out_file, report_file, trace_file, analysis_file;
  int refactorizations = 0;
  bool json = false, quiet = false, verbose = false, condition = false;

  int run() const;
};

/// One run: the phases in order; each returns false when the run is over.
class SolveRun {
 public:
  SolveRun(const SolveCommand& command, Options options)
      : command_(command), progress_(!command.quiet && !command.json), solver_(std::move(options)) {
    record_.precision = solver_.options().precision;
  }

  /// Never throws Error: it ends in record().status.
  void execute() {
    try {
      load();
      if (analyze() && factorize() && refactorize()) solve();
      if (record_.status.ok() && !command_.trace_file.empty()) keep(solver_.write_trace(command_.trace_file));
    } catch (const Error& error) {
      record_.status = error.status();
    } catch (const std::bad_alloc&) {
      record_.status = {StatusCode::out_of_memory, "the machine's memory is too small for this system", -1};
    }
    progress_.abandon();
  }

  [[nodiscard]] const RunRecord& record() const { return record_; }

 private:
  void load() {
    progress_.begin("reading");
    const int threads = solver_.options().threads;
    base::ThreadPool pool(threads > 0 ? threads : base::available_cores());
    matrix_ = command_.source.load(record_, pool);
    b_ = {matrix_.rows, 1, std::vector<double>(static_cast<std::size_t>(matrix_.rows), 1.0)};
    if (!command_.rhs_file.empty()) b_ = read_columns(command_.rhs_file, matrix_.rows, pool);
    record_.columns = b_.cols;
    progress_.end(duration(record_.read_seconds));
  }

  bool keep(const Status& status) {
    record_.status = status;
    return status.ok();
  }

  bool analyze() {
    progress_.begin("analysis");
    record_.analysis = command_.analysis_file.empty() ? solver_.analyze(matrix_)
                                                      : solver_.load_analysis(command_.analysis_file, matrix_);
    if (!keep(record_.analysis->status)) return false;
    progress_.end(duration(record_.analysis->seconds));
    return true;
  }

  bool factorize() {
    progress_.begin("factorization", record_.analysis->predicted_seconds);
    record_.factor = solver_.factorize(matrix_);
    record_.first_factor_seconds = record_.factor->seconds;
    record_.precision = record_.factor->precision;
    record_.analysis = solver_.analysis();  // the kind may have changed from llt to ldlt
    if (!keep(record_.factor->status)) return false;
    progress_.end(fmt::format("{}, {}", duration(record_.factor->seconds), rate(record_.factor->flops_per_second)));
    return true;
  }

  bool refactorize() {
    for (int i = 1; i <= command_.refactorizations; ++i) {
      progress_.begin(fmt::format("refactorization {} of {}", i, command_.refactorizations),
                      record_.first_factor_seconds);
      record_.factor = solver_.refactorize(matrix_.values);
      if (!keep(record_.factor->status)) return false;
      record_.refactor_seconds.push_back(record_.factor->seconds);
      progress_.end(duration(record_.factor->seconds));
    }
    return true;
  }

  void solve() {
    progress_.begin("solve");
    std::vector<double> x(b_.values.size());
    record_.solve = solver_.solve(b_.values, x, b_.cols);
    progress_.end(duration(record_.solve->seconds));
    const bool solved = keep(record_.solve->status);
    if (!solved && record_.status.code != StatusCode::accuracy_not_reached) return;
    if (!command_.out_file.empty())
      matrix::write_matrix_market_vectors(command_.out_file, b_.rows, b_.cols, x, "solution by espalier");
    if (command_.condition) estimate_condition();
  }

  void estimate_condition() {
    const ConditionResult r = solver_.condition_estimate();
    if (!r.status.ok()) return (void)keep(r.status);
    record_.condition_estimate = r.estimate;
  }

  const SolveCommand& command_;
  Progress progress_;
  Solver solver_;
  SparseMatrix matrix_;
  matrix::DenseVectors b_;
  RunRecord record_;
};

void print_outcome(const SolveCommand& command, const RunRecord& record) {
  const bool solved = record.status.ok();
  if (!command.quiet && record.rows > 0) print_result("{}", solve_summary(record));
  if (solved) {
    if (!command.quiet) print_result("\n{}\n", toned(Tone::good, "solved"));
    return;
  }
  if (record.status.code == StatusCode::accuracy_not_reached && !command.out_file.empty()) {
    print_error(record.status.message);
    print_hint(fmt::format("the solution was written to '{}' all the same", command.out_file));
    return;
  }
  print_error(record.status.message);
}

int SolveCommand::run() const {
  Options options = flags.options();
  check_outputs({{"the matrix", source.file()}, {"--rhs", rhs_file}, {"--analysis", analysis_file}},
                {{"--out", out_file}, {"--report", report_file}, {"--trace", trace_file}});
  options.record_timeline = !trace_file.empty();
  if (verbose) options.log = [](const std::string& line) { print_note("{}\n", line); };
  SolveRun run(*this, std::move(options));
  run.execute();
  const RunRecord& record = run.record();
  const auto report = to_json(record);
  const std::optional<Error> unwritten = write_report(report_file, report);
  if (json) {
    print_result("{}\n", to_text(report));
    if (!record.status.ok()) print_error(record.status.message);
  } else {
    print_outcome(*this, record);
  }
  if (unwritten) throw Error(*unwritten);
  return exit_code(record.status.code);
}

}  // namespace

void add_solve(CLI::App& app, Action& action) {
  auto command = std::make_shared<SolveCommand>();
  CLI::App* sub = app.add_subcommand("solve", "Solve A x = b");
  command->source.add_to(*sub);
  add_file(*sub, "--rhs", command->rhs_file, "right-hand side(s), Matrix Market (default: all ones)");
  add_file(*sub, "--out", command->out_file, "write the solution(s) here, Matrix Market array");
  sub->add_option("--refactor", command->refactorizations,
                  "factorize K times more with the same pattern; best time wins")
      ->type_name("K")
      ->check(CLI::Range(0, 1000000));
  add_file(*sub, "--analysis", command->analysis_file, "take the analysis from this file (`analyze --save`)");
  add_file(*sub, "--report", command->report_file, "write the report as JSON here");
  add_file(*sub, "--trace", command->trace_file, "write a timeline here that ui.perfetto.dev opens");
  sub->add_flag("--condition", command->condition, "estimate the condition number (a few more solves)");
  sub->add_flag("--json", command->json, "print the report as JSON instead of the summary");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  sub->add_flag("-v,--verbose", command->verbose, "print the solver's log on stderr");
  command->flags.add_to(*sub);
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
