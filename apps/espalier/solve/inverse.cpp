/// \file
/// `espalier inverse`: entries of the inverse, its diagonal, the trace of its product with a matrix.
#include "espalier/inverse.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <variant>

#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/input.hpp"
#include "common/progress.hpp"
#include "common/solver_flags.hpp"
#include "common/stop_signals.hpp"
#include "common/terminal.hpp"
#include "matrix/file.hpp"
#include "matrix/transform.hpp"
#include "matrix/validate.hpp"
#include "solve/report.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {

namespace {

// A matrix with values of either sort, or the view of one.
template <class Value>
using MatrixOf = std::conditional_t<std::is_same_v<Value, double>, SparseMatrix, ComplexSparseMatrix>;

struct InverseCommand {
  MatrixSource source;
  SolverFlags flags;
  std::string pattern_file, out_file, diagonal_file, trace_file, report_file;
  ProgressLines::Options progress_lines;
  bool json = false, quiet = false;

  int run() const;
  template <class Value>
  int run(const MatrixOf<Value>& a, const RunRecord& record, Progress& progress, base::ThreadPool& pool) const;
};

MatrixView pattern_view(const SparseMatrix& a) { return {a.rows, a.cols, a.col_ptr, a.row_ind, {}, a.storage}; }
MatrixView pattern_view(const ComplexSparseMatrix& a) { return matrix::pattern_of(a); }

SparseMatrix copy_of_pattern(const MatrixView& a) {
  SparseMatrix copy;
  copy.rows = a.rows;
  copy.cols = a.cols;
  copy.col_ptr.assign(a.col_ptr.begin(), a.col_ptr.end());
  copy.row_ind.assign(a.row_ind.begin(), a.row_ind.end());
  copy.storage = a.storage;
  return copy;
}

// A real file serves complex matrices.
ComplexSparseMatrix as_complex(const SparseMatrix& a) {
  ComplexSparseMatrix c;
  c.rows = a.rows;
  c.cols = a.cols;
  c.col_ptr = a.col_ptr;
  c.row_ind = a.row_ind;
  c.values.assign(a.values.begin(), a.values.end());
  c.storage = a.storage;
  return c;
}

template <class Value>
MatrixOf<Value> read_as(const std::string& file, base::ThreadPool& pool) {
  matrix::ReadOptions options;
  options.pool = &pool;
  matrix::AnyMatrix any = matrix::read_any_matrix(file, options);
  if (auto* same = std::get_if<MatrixOf<Value>>(&any)) return std::move(*same);
  if constexpr (std::is_same_v<Value, double>)
    throw Error(StatusCode::invalid_input, file + " is complex, the matrix is real");
  else
    return as_complex(std::get<SparseMatrix>(any));
}

nlohmann::ordered_json number_json(double v) { return v; }
nlohmann::ordered_json number_json(std::complex<double> v) { return {{"real", v.real()}, {"imaginary", v.imag()}}; }

// (A^-1)_ij where `shape` stores (i, j), as a matrix.
template <class Value>
InverseResult entries_at(SolverOf<Value>& solver, const SparseMatrix& shape, bool hermitian, MatrixOf<Value>& to) {
  to.rows = to.cols = shape.cols;
  to.col_ptr = shape.col_ptr;
  to.row_ind = shape.row_ind;
  to.storage = shape.storage;
  if (hermitian) to.storage = Storage::hermitian_lower;
  to.values.resize(to.row_ind.size());
  auto view = to.view();
  view.values = {};
  return selected_inverse(solver, view, std::span(to.values));
}

template <class Value>
int InverseCommand::run(const MatrixOf<Value>& a, const RunRecord& record, Progress& progress,
                        base::ThreadPool& pool) const {
  SparseMatrix shape;
  bool hermitian = false;
  if (!pattern_file.empty()) {
    const matrix::AnyMatrix pattern = matrix::read_any_matrix(pattern_file);
    shape = std::visit([](const auto& p) { return copy_of_pattern(pattern_view(p)); }, pattern);
    if (a.storage == Storage::general) {  // whose inverse has two triangles
      shape.values.assign(shape.row_ind.size(), 1);
      shape = matrix::to_general(shape);
    }
  } else if (!out_file.empty()) {
    const MatrixView own = pattern_view(a);
    shape = own.symmetric() ? copy_of_pattern(own) : matrix::transpose(own);
  }
  if constexpr (!std::is_same_v<Value, double>) hermitian = a.storage >= Storage::hermitian_lower && shape.symmetric();
  MatrixOf<Value> b;
  if (!trace_file.empty()) b = read_as<Value>(trace_file, pool);
  progress.end(duration(record.read_seconds));
  Options options = flags.options();
  options.interrupted = stop_was_asked;
  SolverOf<Value> solver(options);
  nlohmann::ordered_json report = {{"espalier", solver::version()}, {"exit_code", 0}, {"message", ""}};
  Status status;
  double worst = 0;
  std::string line;
  const auto note = [&](const char* name, const InverseResult& r, const std::string& text) {
    report[name] = {{"seconds", r.seconds},
                    {"error", r.error},
                    {"entry_error", r.entry_error},
                    {"checked_columns", r.checked},
                    {"solved_columns", r.solved}};
    status = r.status;
    if (r.error > worst) worst = r.error;
    line += (line.empty() ? "" : ", ") + text;
  };
  const auto goes_on = [&] { return status.ok() || status.code == StatusCode::accuracy_not_reached; };
  MatrixOf<Value> entries;
  std::vector<Value> diagonal(static_cast<std::size_t>(a.cols));
  Status inaccurate;
  {
    const StopSignals signals;
    progress.begin("analysis");
    const AnalysisResult analysis = solver.analyze(a);
    status = analysis.status;
    double factorization = 0;
    if (status.ok()) {
      progress.end(duration(analysis.seconds));
      progress.begin("factorization");
      const auto f = solver.factorize(a);
      factorization = f.seconds;
      status = f.status;
      report["log_determinant"] = f.determinant_log;
      if (status.ok()) progress.end(duration(f.seconds));
    }
    report["seconds"] = {{"analysis", analysis.seconds}, {"factorization", factorization}};
    const auto take = [&](auto&& step) {
      if (!goes_on()) return;
      if (!status.ok()) inaccurate = status;
      step();
    };
    if (status.ok()) progress.begin("inverse");
    if (!out_file.empty())
      take([&] {
        const InverseResult r = entries_at<Value>(solver, shape, hermitian, entries);
        note("entries", r, fmt::format("{} entries", entries.values.size()));
      });
    if (!diagonal_file.empty() || (out_file.empty() && trace_file.empty()))
      take([&] {
        const InverseResult r = inverse_diagonal(solver, std::span(diagonal));
        Value sum = 0;
        for (const Value v : diagonal) sum += v;
        if constexpr (std::is_same_v<Value, double>)
          note("diagonal", r, fmt::format("trace {:.15g}", sum));
        else
          note("diagonal", r, fmt::format("trace {:.15g} {:+.15g} i", sum.real(), sum.imag()));
        report["diagonal"]["sum"] = number_json(sum);
      });
    if (!trace_file.empty())
      take([&] {
        const auto r = trace_of_inverse(solver, b.view());
        if constexpr (std::is_same_v<Value, double>)
          note("trace", r, fmt::format("trace of the product {:.15g}", r.trace));
        else
          note("trace", r, fmt::format("trace of the product {:.15g} {:+.15g} i", r.trace.real(), r.trace.imag()));
        report["trace"]["value"] = number_json(r.trace);
        report["trace"]["value_error"] = r.trace_error;
      });
  }
  progress.abandon();
  const bool stopped = status.code == StatusCode::cancelled, whole = goes_on();
  if (status.ok()) status = inaccurate;
  const int code = stopped ? static_cast<int>(kInterrupted) : exit_code(status.code);
  report["exit_code"] = code;
  report["message"] = status.message;
  report["unknowns"] = a.rows;
  const std::optional<Error> unwritten = write_report(report_file, report);
  if (whole && !out_file.empty())
    matrix::write_matrix_market(out_file, entries.view(), "entries of the inverse by espalier");
  if (whole && !diagonal_file.empty())
    matrix::write_matrix_market_vectors(diagonal_file, a.rows, 1, diagonal, "diagonal of the inverse by espalier");
  if (json)
    print_result("{}\n", to_text(report));
  else if (!quiet && whole)
    print_result("inverse of {} unknowns: {}; error {:.1e} of a column's largest entry\n", a.rows, line, worst);
  if (stopped)
    print_note("espalier: stopped\n");
  else if (!status.ok())
    print_error(status.message);
  if (unwritten) throw Error(*unwritten);
  return code;
}

int InverseCommand::run() const {
  check_outputs({{"A", source.file()}, {"--pattern", pattern_file}, {"--trace", trace_file}},
                {{"--out", out_file}, {"--diagonal", diagonal_file}, {"--report", report_file}});
  if (!pattern_file.empty() && out_file.empty())
    throw Error(StatusCode::invalid_input, "--pattern says which entries --out writes: give both");
  Progress progress(!quiet && !json, "inverse", progress_lines);
  RunRecord record;
  progress.begin("reading");
  const int threads = flags.options().threads;
  base::ThreadPool pool(threads > 0 ? threads : base::available_cores());
  const matrix::AnyMatrix a = source.load(record, pool);
  if (const auto* real = std::get_if<SparseMatrix>(&a)) return run<double>(*real, record, progress, pool);
  return run<std::complex<double>>(std::get<ComplexSparseMatrix>(a), record, progress, pool);
}

}  // namespace

void add_inverse(CLI::App& app, Action& action) {
  auto command = std::make_shared<InverseCommand>();
  CLI::App* sub =
      app.add_subcommand("inverse", "Entries of the inverse of a matrix: its diagonal, its pattern, traces");
  command->source.add_to(*sub);
  add_file(*sub, "--diagonal", command->diagonal_file, "write the diagonal of the inverse here, Matrix Market array");
  add_file(*sub, "--out", command->out_file,
           "write the inverse here, where the transposed matrix has entries, Matrix Market");
  add_file(*sub, "--pattern", command->pattern_file, "where this matrix has entries instead; its values do not matter");
  add_file(*sub, "--trace", command->trace_file, "a matrix B: tell the trace of the inverse times B");
  add_file(*sub, "--report", command->report_file, "write the report as JSON here");
  sub->add_flag("--json", command->json, "print the report as JSON instead of a line");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  command->progress_lines.add_to(*sub);
  command->flags.add_to(*sub);
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
