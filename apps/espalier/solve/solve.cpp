/// \file
/// `espalier solve`: analyze, factorize, solve, report.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <complex>
#include <memory>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "base/timeline.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/input.hpp"
#include "common/progress.hpp"
#include "common/solver_flags.hpp"
#include "common/stop_signals.hpp"
#include "common/terminal.hpp"
#include "espalier/factor_file.hpp"
#include "mpi/launched_ranks.hpp"
#include "solve/solve_page.hpp"
#include "solve/summary.hpp"

namespace espalier::cli {

namespace {

struct SolveCommand {
  MatrixSource source;
  SolverFlags flags;
  std::string rhs_file, out_file, report_file, trace_file, analysis_file, page_file, factor_file, save_factor_file;
  int refactorizations = 0;
  RankOptions ranks;
  ProgressLines::Options progress_lines;
  bool json = false, quiet = false, verbose = false, condition = false;

  int run() const;
};

/// What a run takes of each sort of numbers.
template <class Value>
struct Sort {
  using Matrix = SparseMatrix;
  using Columns = RealColumns;
  static constexpr auto read = read_columns;
  static constexpr auto load = load_factor;
  static Solver solver(const LaunchedRanks& launched, const Options& options) { return {launched.ranks(), options}; }
};
template <>
struct Sort<std::complex<double>> {
  using Matrix = ComplexSparseMatrix;
  using Columns = ComplexColumns;
  static constexpr auto read = read_complex_columns;
  static constexpr auto load = load_complex_factor;
  static ComplexSolver solver(const LaunchedRanks& launched, const Options& options) {
    return {launched.ranks(), options};
  }
};

/// One run: the phases in order; each returns false when the run is over.
template <class Value>
class SolveRun {
 public:
  using Matrix = typename Sort<Value>::Matrix;

  SolveRun(const SolveCommand& command, const LaunchedRanks& launched, const Options& options, Matrix matrix,
           RunRecord& record, SolvePictures& pictures, Progress& progress)
      : command_(command),
        launched_(launched),
        progress_(progress),
        solver_(Sort<Value>::solver(launched, options)),
        matrix_(std::move(matrix)),
        record_(record),
        pictures_(pictures) {}

  /// With the factor of --factor, whose matrix is `any`, if that was given.
  void execute_loaded(base::ThreadPool& pool, const matrix::AnyMatrix* any) {
    const std::string& file = command_.factor_file;
    const auto start = base::now_seconds();
    auto loaded = Sort<Value>::load(file, solver_.options());
    record_.note(loaded.result);
    if (!keep(loaded.result.status)) return;
    solver_ = std::move(loaded.solver);
    by_rows_ = loaded.by_rows;
    record_.first_factor_seconds = record_.factor->seconds;
    record_.precision = record_.factor->precision;
    record_.analysis = solver_.analysis();
    matrix_ = factorized_matrix(solver_);
    if (any != nullptr) {
      expect_same(*any);
    } else {
      record_.input = file;
      record_.rows = matrix_.rows;
      record_.nonzeros = matrix_.nonzeros();
      record_.storage = loaded.storage;
      record_.read_seconds = base::now_seconds() - start;
    }
    if (!command_.page_file.empty()) take_pictures();
    load(pool);
    if (refactorize() && save_factor()) solve();
    if (record_.status.ok() && !command_.trace_file.empty()) keep(solver_.write_trace(command_.trace_file));
  }

  void execute(base::ThreadPool& pool) {
    if (!keep(launched_.on_all([&] { return share_right_hand_sides(pool); }))) return;
    if (analyze() && factorize() && refactorize() && save_factor()) solve();
    if (record_.status.ok() && !command_.trace_file.empty()) keep(solver_.write_trace(command_.trace_file));
  }

 private:
  void expect_same(const matrix::AnyMatrix& any) const {
    const auto* given = std::get_if<Matrix>(&any);
    const bool same = given != nullptr && !by_rows_ && solver_.has_pattern(*given) && solver_.values() == given->values;
    if (!same)
      throw Error(StatusCode::invalid_input,
                  command_.factor_file +
                      ": the factor is of another matrix, or of one that is stored otherwise; leave the "
                      "matrix out, or --factor");
  }

  // Rank 0 reads for all.
  Status share_right_hand_sides(base::ThreadPool& pool) {
    if (launched_.first()) load(pool);
    b_.cols = static_cast<Index>(launched_.from_first(b_.cols));
    return {};
  }

  void take_pictures() {
    const MatrixView pattern{matrix_.rows, matrix_.cols, matrix_.col_ptr, matrix_.row_ind, {}, matrix_.storage};
    pictures_.given = spy_of(pattern);
    pictures_.tiers = solver_.tiers();
    if constexpr (std::is_same_v<Value, double>) take_order(pictures_, pattern, solver_);
  }

  void load(base::ThreadPool& pool) {
    b_.rows = matrix_.rows;
    b_.cols = 1;
    b_.values.assign(static_cast<std::size_t>(matrix_.rows), Value(1));
    if (!command_.rhs_file.empty()) b_ = Sort<Value>::read(command_.rhs_file, matrix_.rows, pool);
    record_.columns = b_.given();
    progress_.end(duration(record_.read_seconds));
  }

  bool keep(const Status& status) {
    record_.status = status;
    return status.ok();
  }

  bool save_factor() {
    return command_.save_factor_file.empty() ||
           keep(espalier::save_factor(solver_, command_.save_factor_file, by_rows_));
  }

  bool analyze() {
    progress_.begin("analysis");
    record_.analysis = command_.analysis_file.empty() ? solver_.analyze(matrix_)
                                                      : solver_.load_analysis(command_.analysis_file, matrix_);
    if (!keep(record_.analysis->status)) return false;
    progress_.end(duration(record_.analysis->seconds));
    if (!command_.page_file.empty()) take_pictures();
    return true;
  }

  bool factorize() {
    progress_.begin("factorization", record_.analysis->predicted_seconds);
    record_.note(solver_.factorize(matrix_));
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
      record_.note(solver_.refactorize(matrix_.values));
      if (!keep(record_.factor->status)) return false;
      record_.refactor_seconds.push_back(record_.factor->seconds);
      progress_.end(duration(record_.factor->seconds));
    }
    return true;
  }

  void solve() {
    progress_.begin("solve");
    typename Sort<Value>::Columns x = b_;
    record_.solve = solver_.solve(b_.values, x.values, b_.cols, by_rows_ ? Transpose::yes : Transpose::no);
    progress_.end(duration(record_.solve->seconds));
    const bool solved = keep(record_.solve->status);
    if (!solved && record_.status.code != StatusCode::accuracy_not_reached) return;
    if (!command_.out_file.empty() && launched_.first()) write_columns(command_.out_file, x, "solution by espalier");
    if (command_.condition) estimate_condition();
  }

  void estimate_condition() {
    const ConditionResult r = solver_.condition_estimate();
    if (!r.status.ok()) return (void)keep(r.status);
    record_.condition_estimate = r.estimate;
  }

  const SolveCommand& command_;
  const LaunchedRanks& launched_;
  Progress& progress_;
  SolverOf<Value> solver_;
  Matrix matrix_;
  typename Sort<Value>::Columns b_;
  RunRecord& record_;
  SolvePictures& pictures_;
  bool by_rows_ = false;  // the solver holds the transpose
};

/// Rank 0 reads for all. @returns why it cannot be solved
Status share_matrix(const SolveCommand& command, const LaunchedRanks& launched, RunRecord& record,
                    base::ThreadPool& pool, matrix::AnyMatrix& any) {
  if (launched.first()) any = command.source.load(record, pool);
  record.complex = launched.from_first(record.complex ? 1 : 0) != 0;
  if (record.complex && !launched.first()) any = ComplexSparseMatrix();
  return {};
}

/// With the factor of a file. @param any  its matrix, for comparison; null: it was not given
void with_factor(const SolveCommand& command, const LaunchedRanks& launched, const Options& options,
                 const matrix::AnyMatrix* any, RunRecord& record, SolvePictures& pictures, Progress& progress,
                 base::ThreadPool& pool) {
  record.complex = is_complex_factor(command.factor_file);
  if (record.complex)
    SolveRun<std::complex<double>>(command, launched, options, {}, record, pictures, progress)
        .execute_loaded(pool, any);
  else
    SolveRun<double>(command, launched, options, {}, record, pictures, progress).execute_loaded(pool, any);
}

/// Never throws Error: it ends in the record's status.
RunRecord execute(const SolveCommand& command, const LaunchedRanks& launched, const Options& options,
                  SolvePictures& pictures) {
  RunRecord record;
  Progress progress(!command.quiet && !command.json && launched.first(), "solve",
                    launched.first() ? command.progress_lines : ProgressLines::Options{});
  record.precision = options.precision;
  try {
    progress.begin("reading");
    base::ThreadPool pool(options.threads > 0 ? options.threads : base::available_cores());
    matrix::AnyMatrix any;
    const bool loads = !command.factor_file.empty();
    if (!loads || command.source.given())
      record.status = launched.on_all([&] { return share_matrix(command, launched, record, pool, any); });
    if (loads && record.status.ok())
      with_factor(command, launched, options, command.source.given() ? &any : nullptr, record, pictures, progress,
                  pool);
    else if (record.status.ok() && record.complex)
      SolveRun<std::complex<double>>(command, launched, options, std::get<ComplexSparseMatrix>(std::move(any)), record,
                                     pictures, progress)
          .execute(pool);
    else if (record.status.ok())
      SolveRun<double>(command, launched, options, std::get<SparseMatrix>(std::move(any)), record, pictures, progress)
          .execute(pool);
  } catch (const Error& error) {
    record.status = error.status();
  } catch (const std::bad_alloc&) {
    record.status = {StatusCode::out_of_memory, "the machine's memory is too small for this system", -1};
  }
  progress.abandon();
  return record;
}

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
  check_outputs(
      {{"the matrix", source.file()}, {"--rhs", rhs_file}, {"--analysis", analysis_file}, {"--factor", factor_file}},
      {{"--out", out_file},
       {"--report", report_file},
       {"--trace", trace_file},
       {"--page", page_file},
       {"--save-factor", save_factor_file}});
  options.record_timeline = !trace_file.empty();
  if (verbose) options.log = [](const std::string& line) { print_note("{}\n", line); };
  // Who reads along wants the last line, also where the command is stopped.
  std::optional<StopSignals> signals;
  if (progress_lines.wanted()) {
    options.interrupted = stop_was_asked;
    signals.emplace();
  }
  if (!factor_file.empty() && !analysis_file.empty())
    throw Error(StatusCode::invalid_input, "a factor has its analysis: leave --analysis or --factor out");
  LaunchedRanks launched(ranks);
  if (launched.ranks().size() > 1 && !(factor_file.empty() && save_factor_file.empty()))
    throw Error(StatusCode::invalid_input, "--factor and --save-factor are for one process");
  if (launched.ranks().size() > 1 && !trace_file.empty())
    throw Error(StatusCode::invalid_input, "--trace shows one process; leave it out on several ranks");
  SolvePictures pictures;
  const RunRecord record = execute(*this, launched, options, pictures);
  if (record.status.code == StatusCode::device_error) launched.leave_open();
  if (!launched.first()) return exit_code(record.status.code);  // rank 0 speaks for all
  const auto report = to_json(record);
  const std::optional<Error> unwritten = write_report(report_file, report);
  if (json) {
    print_result("{}\n", to_text(report));
    if (!record.status.ok()) print_error(record.status.message);
  } else {
    print_outcome(*this, record);
  }
  if (!page_file.empty()) write_page(page_file, solve_sheet(record, report, pictures, trace_file), quiet || json);
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
  add_file(*sub, "--save-factor", command->save_factor_file, "write the factor here, with matrix and analysis");
  add_file(*sub, "--factor", command->factor_file, "take matrix and factor from this file (`solve --save-factor`)");
  add_file(*sub, "--report", command->report_file, "write the report as JSON here");
  add_file(*sub, "--trace", command->trace_file, "write a timeline here that ui.perfetto.dev opens");
  add_page(*sub, command->page_file, "solve.html");
  sub->add_flag("--condition", command->condition, "estimate the condition number (a few more solves)");
  sub->add_flag("--json", command->json, "print the report as JSON instead of the summary");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  sub->add_flag("-v,--verbose", command->verbose, "print the solver's log on stderr");
  command->ranks.add_to(*sub);
  command->progress_lines.add_to(*sub);
  command->flags.add_to(*sub);
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
