/// \file
/// `espalier condense`: the Schur complement of some unknowns, and condensed right-hand sides.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/input.hpp"
#include "common/progress.hpp"
#include "common/solver_flags.hpp"
#include "common/stop_signals.hpp"
#include "common/terminal.hpp"
#include "espalier/schur.hpp"
#include "matrix/file.hpp"
#include "solve/report.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {

namespace {

struct CondenseCommand {
  MatrixSource source;
  SolverFlags flags;
  std::string unknowns, list_file, rhs_file, out_file, out_rhs_file, report_file;
  ProgressLines::Options progress_lines;
  bool json = false, quiet = false, no_inertia = false;

  int run() const;
};

std::string listed(const CondenseCommand& command) {
  if (command.unknowns.empty() == command.list_file.empty())
    throw Error(StatusCode::invalid_input, "give the unknowns to keep, either --unknowns 0,5,10-20 or --list FILE");
  if (command.list_file.empty()) return command.unknowns;
  return std::string(matrix::FileBytes(command.list_file).bytes());
}

nlohmann::ordered_json inertia_json(const Inertia& i) {
  return {{"positive", i.positive}, {"negative", i.negative}, {"zero", i.zero}};
}

int CondenseCommand::run() const {
  Options options = flags.options();
  options.interrupted = stop_was_asked;
  check_outputs({{"A", source.file()}, {"--list", list_file}, {"--rhs", rhs_file}},
                {{"--out", out_file}, {"--out-rhs", out_rhs_file}, {"--report", report_file}});
  if (rhs_file.empty() != out_rhs_file.empty())
    throw Error(StatusCode::invalid_input, "--rhs and --out-rhs go together: what is condensed, and where it goes");
  const std::string wanted = listed(*this);
  Progress progress(!quiet && !json, "condense", progress_lines);
  RunRecord record;
  progress.begin("reading");
  base::ThreadPool pool(options.threads > 0 ? options.threads : base::available_cores());
  const SparseMatrix a = source.load_real(record, pool);
  const std::vector<Index> list = parse_unknowns(wanted, a.rows);
  RealColumns b;
  if (!rhs_file.empty()) b = read_columns(rhs_file, a.rows, pool);
  progress.end(duration(record.read_seconds));
  SchurComplement schur(options);
  SchurResult r;
  SchurInertia inertia;
  SolveResult condensed;
  std::vector<double> g(list.size() * static_cast<std::size_t>(b.cols));
  Status status;
  AnalysisResult analysis;
  {
    const StopSignals signals;
    progress.begin("analysis");
    analysis = schur.analyze(a, list);
    status = analysis.status;
    if (status.ok()) {
      progress.end(duration(analysis.seconds));
      progress.begin("factorization and complement");
      r = schur.factorize(a.values);
      status = r.status;
    }
    if (status.ok()) progress.end(duration(r.seconds));
    if (status.ok() && !no_inertia) inertia = schur.inertia();
    if (status.ok() && b.cols > 0) {
      condensed = schur.condense(b.values, g, b.cols);
      status = condensed.status;
    }
  }
  progress.abandon();
  const bool stopped = status.code == StatusCode::cancelled;
  const int code = stopped ? static_cast<int>(kInterrupted) : exit_code(status.code);
  nlohmann::ordered_json report = {
      {"espalier", solver::version()},
      {"exit_code", code},
      {"message", status.message},
      {"unknowns", a.rows},
      {"listed", list.size()},
      {"rank_of_rest", r.rest.rank},
      {"dependent_rows", r.rest.dependent_rows},
      {"inertia", {{"rest", inertia_json(inertia.rest)}, {"complement", inertia_json(inertia.complement)}}},
      {"by_elimination", r.by_elimination},
      {"backward_error", condensed.backward_error},
      {"seconds",
       {{"analysis", analysis.seconds}, {"factorization", r.seconds}, {"complement", r.complement_seconds}}}};
  const std::optional<Error> unwritten = write_report(report_file, report);
  const auto size = static_cast<Index>(list.size());
  if (schur.factorized() && !out_file.empty()) {
    const std::vector<double> s(schur.complement().begin(), schur.complement().end());
    matrix::write_matrix_market_vectors(out_file, size, size, s, "Schur complement by espalier");
  }
  if (status.ok() && b.cols > 0)
    write_columns(out_rhs_file, RealColumns{{size, b.cols, std::move(g)}, b.complex}, "condensed by espalier");
  if (json)
    print_result("{}\n", to_text(report));
  else if (!quiet && status.ok())
    print_result(
        "{} of {} unknowns kept; the rest has {} positive, {} negative eigenvalues, the complement {} and {} and {} "
        "at zero\n",
        list.size(), a.rows, inertia.rest.positive, inertia.rest.negative, inertia.complement.positive,
        inertia.complement.negative, inertia.complement.zero);
  if (stopped)
    print_note("espalier: stopped\n");
  else if (!status.ok())
    print_error(status.message);
  if (unwritten) throw Error(*unwritten);
  return code;
}

}  // namespace

void add_condense(CLI::App& app, Action& action) {
  auto command = std::make_shared<CondenseCommand>();
  CLI::App* sub = app.add_subcommand("condense", "Condense a matrix onto some unknowns: its Schur complement");
  command->source.add_to(*sub);
  sub->add_option("--unknowns", command->unknowns, "those to keep, from 0, in this order: 0,5,10-20")
      ->type_name("LIST");
  add_file(*sub, "--list", command->list_file, "the same from a file, with blanks or lines between");
  add_file(*sub, "--out", command->out_file, "write the complement here, Matrix Market array");
  add_file(*sub, "--rhs", command->rhs_file, "right-hand sides to condense, Matrix Market");
  add_file(*sub, "--out-rhs", command->out_rhs_file, "write them here");
  sub->add_flag("--no-inertia", command->no_inertia, "do not factorize the complement for its eigenvalues' signs");
  add_file(*sub, "--report", command->report_file, "write the report as JSON here");
  sub->add_flag("--json", command->json, "print the report as JSON instead of a line");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  command->progress_lines.add_to(*sub);
  command->flags.add_to(*sub);
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
