/// \file
/// `espalier modes`: the lowest eigenvalues of K x = l M x, or load factors of K x = l Kg x.
#include "espalier/modes.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "base/memory.hpp"
#include "base/output_file.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/progress.hpp"
#include "common/solver_flags.hpp"
#include "common/stop_signals.hpp"
#include "common/terminal.hpp"
#include "dynamics/mesh/read/formats.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/matrix_market.hpp"
#include "matrix/read.hpp"
#include "mpi/launched_ranks.hpp"
#include "pencils/model_modes.hpp"
#include "pencils/pencil_command.hpp"
#include "pencils/pencil_pages.hpp"
#include "pencils/quadratic_modes.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {

namespace {

using Json = nlohmann::ordered_json;

struct ModesCommand {
  std::string k_file, m_file, damping_file, generator, out_file, csv_file, report_file, page_file, speeds, over;
  std::vector<std::string> set;
  ModesOptions options;
  SolverFlags flags;
  ProgressLines::Options progress_lines;
  bool buckling = false, json = false, quiet = false, verbose = false, no_proof = false, trust_mass = false;

  int run();
  int run_model();
  int run_quadratic(const SparseMatrix& k, const SparseMatrix& m, base::ThreadPool& pool, Progress& progress);
  [[nodiscard]] std::string title() const { return generator.empty() ? k_file : "modes of " + generator; }
  [[nodiscard]] std::pair<SparseMatrix, SparseMatrix> matrices(base::ThreadPool& pool) const;
};

std::pair<SparseMatrix, SparseMatrix> ModesCommand::matrices(base::ThreadPool& pool) const {
  if (generator.empty()) {
    if (const std::string advice = dynamics::mesh_is_no_model(k_file); !advice.empty() && m_file.empty())
      throw Error(StatusCode::invalid_input, advice);
    if (k_file.empty() || m_file.empty())
      throw Error(StatusCode::invalid_input, "give two matrix files, K and M, or --generate \"elasticity NX NY NZ\"");
    const matrix::ReadOptions from_file = reading(pool, quiet || json);
    return {matrix::read_matrix(k_file, from_file), matrix::read_matrix(m_file, from_file)};
  }
  std::istringstream stream(generator);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  matrix::GeneratorSpec spec = matrix::parse_generator(words);
  if (spec.family != matrix::Family::elasticity)
    throw Error(StatusCode::invalid_input,
                fmt::format("--generate {}: a mass is known for elasticity NX NY NZ alone", generator));
  SparseMatrix k = matrix::generate(spec, &pool);
  spec.family = matrix::Family::elasticity_mass;
  return {std::move(k), matrix::generate(spec, &pool)};
}

// l is the square of an angular frequency; NaN where it is negative.
double frequency(double l) {
  return l >= 0 ? std::sqrt(l) / (2 * std::numbers::pi) : std::numeric_limits<double>::quiet_NaN();
}

std::string table_of(const ModesResult& r, bool buckling) {
  Table table(buckling ? ">>>>" : ">>>>>");
  std::vector<std::string> head = {"mode", buckling ? "load factor" : "eigenvalue", "residual", "error bound"};
  if (!buckling) head.insert(head.begin() + 2, "frequency");
  table.add(head, Tone::quiet);
  for (std::size_t i = 0; i < r.eigenvalues.size(); ++i) {
    const double l = r.eigenvalues[i];
    std::vector<std::string> row = {fmt::format("{}", i + 1), fmt::format("{:.12g}", l), small(r.residuals[i]),
                                    small(r.error_bounds[i])};
    if (!buckling) row.insert(row.begin() + 2, l >= 0 ? fmt::format("{:.9g}", frequency(l)) : "-");
    table.add(row);
  }
  return table.text();
}

std::string cost_of(const ModesResult& r) {
  const ModesSeconds& s = r.seconds;
  Table table("<<");
  table.add({"unknowns", fmt::format("{}{}", grouped(r.n),
                                     r.massless > 0 ? fmt::format(", {} without mass", grouped(r.massless)) : "")});
  table.add({"time", fmt::format("{}: mass {}, analysis {}, {} in {}, {} in {}, orthogonalization {}, products {}",
                                 duration(s.total), duration(s.mass), duration(s.analysis),
                                 counted(r.factorizations, "factorization", "factorizations"),
                                 duration(s.factorization), counted(r.solved_columns, "solve", "solves"),
                                 duration(s.solves), duration(s.orthogonalization), duration(s.products))});
  table.add({"memory", base::format_bytes(r.peak_bytes)});
  table.add({"orthogonal", fmt::format("to {}", small(r.orthogonality))});
  table.add({"complete", r.complete ? "proven: " + r.completeness : r.completeness});
  return table.text();
}

Json report_of(const ModesCommand& command, const ModesResult& r, int code) {
  Json modes = Json::array();
  for (std::size_t i = 0; i < r.eigenvalues.size(); ++i) {
    Json mode = {{"eigenvalue", r.eigenvalues[i]}};
    if (!command.buckling && r.eigenvalues[i] >= 0) mode["frequency"] = frequency(r.eigenvalues[i]);
    mode["residual"] = r.residuals[i];
    mode["error_bound"] = r.error_bounds[i];
    modes.push_back(std::move(mode));
  }
  Json counts = Json::array();
  for (const ModeCount& c : r.counts) counts.push_back({{"at", c.at}, {"below", c.below}});
  const ModesSeconds& s = r.seconds;
  return {{"espalier", solver::version()},
          {"exit_code", code},
          {"message", r.status.message},
          {"problem", command.buckling ? "buckling" : "vibration"},
          {"unknowns", r.n},
          {"massless", r.massless},
          {"finite", r.finite},
          {"modes", modes},
          {"orthogonality", r.orthogonality},
          {"complete", r.complete},
          {"completeness", r.completeness},
          {"counts", counts},
          {"factorizations", r.factorizations},
          {"solved_columns", r.solved_columns},
          {"restarts", r.restarts},
          {"peak_bytes", r.peak_bytes},
          {"seconds",
           {{"total", s.total},
            {"mass", s.mass},
            {"analysis", s.analysis},
            {"factorization", s.factorization},
            {"solves", s.solves},
            {"orthogonalization", s.orthogonalization},
            {"products", s.products}}}};
}

void write_csv(const std::string& path, const ModesResult& r) {
  std::string text = "mode,eigenvalue,frequency,residual,error_bound\n";
  for (std::size_t i = 0; i < r.eigenvalues.size(); ++i)
    text += fmt::format("{},{},{},{},{}\n", i + 1, r.eigenvalues[i],
                        r.eigenvalues[i] >= 0 ? fmt::format("{}", frequency(r.eigenvalues[i])) : "", r.residuals[i],
                        r.error_bounds[i]);
  base::OutputFile file(path);
  file.write(text);
  file.commit();
}

int ModesCommand::run_quadratic(const SparseMatrix& k, const SparseMatrix& m, base::ThreadPool& pool,
                                Progress& progress) {
  if (buckling || !std::isinf(options.below) || !out_file.empty() || !csv_file.empty())
    throw Error(StatusCode::invalid_input, "--damping: --buckling, --below, --out and --csv do not go with it");
  const SparseMatrix c = matrix::read_matrix(damping_file, reading(pool, quiet || json));
  QuadraticModesOptions o;
  o.count = options.count > 0 ? options.count : 6;
  o.shift = options.shift;
  o.tolerance = options.tolerance;
  o.basis_size = options.basis_size;
  o.seed = options.seed;
  o.solver = options.solver;
  QuadraticModesResult r;
  {
    const StopSignals signals;
    progress.begin("modes");
    r = find_quadratic_modes(k, c, m, o);
  }
  progress.abandon();
  return conclude(
      {json, quiet, report_file, page_file}, r.status, [&](int code) { return quadratic_report(r, code); }, [] {},
      [&](const Json& report) { return quadratic_sheet(title(), r, report); }, r.count() > 0 ? quadratic_table(r) : "");
}

int ModesCommand::run_model() {
  const ModesOptions plain;
  for (const auto& [given, name] : {std::pair{!m_file.empty(), "a second matrix"},
                                    {!damping_file.empty(), "--damping"},
                                    {!generator.empty(), "--generate"},
                                    {!out_file.empty(), "--out"},
                                    {buckling, "--buckling"},
                                    {!std::isinf(options.below), "--below"},
                                    {!std::isnan(options.shift), "--shift"},
                                    {options.tolerance != plain.tolerance, "--tolerance"},
                                    {options.block_size != plain.block_size, "--block-size"},
                                    {options.basis_size != plain.basis_size, "--basis-size"},
                                    {no_proof, "--no-proof"},
                                    {trust_mass, "--trust-mass"}})
    if (given) throw Error(StatusCode::invalid_input, fmt::format("modes of a model: {} does not go with it", name));
  check_outputs({{"MODEL", k_file}}, {{"--csv", csv_file}, {"--report", report_file}, {"--page", page_file}});
  ModelModesCommand command{
      k_file, speeds, over, csv_file, static_cast<int>(options.count), {}, {json, quiet, report_file, page_file}};
  command.options.set = set;
  for (const auto& [key, value] : flags.values()) command.options.solver.emplace_back(key, value);
  command.options.interrupted = stop_was_asked;
  const StopSignals signals;
  Progress progress(!quiet && !json, "modes", progress_lines);
  return run_model_modes(command, progress);
}

int ModesCommand::run() {
  expect_one_process("modes");
  if (k_file.ends_with(".toml") || (m_file.empty() && dynamics::is_deck(k_file))) return run_model();
  if (!speeds.empty() || !over.empty() || !set.empty())
    throw Error(StatusCode::invalid_input, "--speeds, --over and --set are of a model: give a file MODEL.toml");
  refuse_chosen_flags(flags, "modes choose");
  options.solver = flags.options();
  options.prove = !no_proof;
  options.check_mass = !trust_mass;
  check_outputs({{"K", k_file}, {"M", m_file}, {"--damping", damping_file}},
                {{"--out", out_file}, {"--csv", csv_file}, {"--report", report_file}, {"--page", page_file}});
  if (verbose) options.solver.log = [](const std::string& line) { print_note("{}\n", line); };
  options.solver.interrupted = stop_was_asked;
  Progress progress(!quiet && !json, "modes", progress_lines);
  progress.begin("reading");
  base::ThreadPool pool(options.solver.threads > 0 ? options.solver.threads : base::available_cores());
  const auto [k, m] = matrices(pool);
  progress.end("");
  if (!damping_file.empty()) return run_quadratic(k, m, pool, progress);
  progress.begin("modes");
  ModesResult r;
  {
    const StopSignals signals;
    r = buckling ? find_buckling_modes(k, m, options) : find_modes(k, m, options);
  }
  if (r.status.ok())
    progress.end(fmt::format("{} found in {}", counted(r.count(), "mode", "modes"), duration(r.seconds.total)));
  progress.abandon();
  const auto files = [&] {
    if (!csv_file.empty() && r.count() > 0) write_csv(csv_file, r);
    if (!out_file.empty() && r.count() > 0)
      matrix::write_matrix_market_vectors(out_file, r.n, r.count(), r.vectors, "modes by espalier");
  };
  return conclude(
      {json, quiet, report_file, page_file}, r.status, [&](int code) { return report_of(*this, r, code); }, files,
      [&](const Json& report) { return modes_sheet(title(), r, buckling, report); },
      r.n > 0 ? table_of(r, buckling) + "\n" + cost_of(r) : "");
}

void add_search(CLI::App& sub, ModesCommand& command) {
  ModesOptions& o = command.options;
  sub.add_option("--count", o.count, "so many of the lowest modes")->type_name("N")->check(CLI::Range(1, 1000000));
  sub.add_option("--below", o.below, "all modes whose eigenvalue is below this number")
      ->type_name("L")
      ->check(number());
  sub.add_option("--shift", o.shift, "where the search begins (default: a little below zero)")
      ->type_name("S")
      ->check(finite());
  sub.add_option("--tolerance", o.tolerance, "of a mode's residual in the search (default 1e-10)")
      ->type_name("T")
      ->check(positive());
  sub.add_option("--block-size", o.block_size, "vectors solved for at a time (default 8)")
      ->type_name("B")
      ->check(CLI::Range(1, 256));
  sub.add_option("--basis-size", o.basis_size, "most vectors kept at a time (default: by N and memory)")
      ->type_name("V")
      ->check(CLI::Range(1, 1000000));
  sub.add_flag("--buckling", command.buckling, "the second matrix is Kg: the smallest positive l of K x = l Kg x");
  sub.add_flag("--no-proof", command.no_proof, "no count at the end: one factorization less, and no proof");
  sub.add_flag("--trust-mass", command.trust_mass, "M is semi-definite: it is not factorized, and nothing is proven");
}

}  // namespace

void add_modes(CLI::App& app, Action& action) {
  auto command = std::make_shared<ModesCommand>();
  CLI::App* sub = app.add_subcommand("modes", "The lowest modes of K x = l M x, or of a model (docs/use/modes.md)");
  add_file(*sub, "K", command->k_file, "the stiffness: Matrix Market or Rutherford-Boeing, also .gz; or MODEL.toml");
  add_file(*sub, "M", command->m_file, "the mass; with --buckling Kg");
  sub->add_option("--generate", command->generator, "both matrices: \"elasticity NX NY NZ\"")->type_name("\"SPEC\"");
  add_search(*sub, *command);
  sub->add_option("--speeds", command->speeds, "of a model's [initial] rotation: a Campbell diagram")
      ->type_name("BEGIN:END:STEP");
  sub->add_option("--over", command->over, "of another number of a model, such as parameters.speed")
      ->type_name("PATH=BEGIN:END:STEP");
  sub->add_option("--set", command->set, "PATH=VALUE: a value of the model instead of the one in the file")
      ->type_name("PATH=VALUE")
      ->take_all()
      ->allow_extra_args(false);
  add_file(*sub, "--damping", command->damping_file,
           "C of (l^2 M + l C + K) x = 0: the few modes nearest to the shift (default 6), of any real matrices");
  add_file(*sub, "--out", command->out_file, "write the shapes here, Matrix Market array, one column a mode");
  add_file(*sub, "--csv", command->csv_file, "write eigenvalues, frequencies and residuals here");
  add_file(*sub, "--report", command->report_file, "write the report as JSON here");
  add_page(*sub, command->page_file, "modes.html");
  sub->add_flag("--json", command->json, "print the report as JSON instead of the table");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  sub->add_flag("-v,--verbose", command->verbose, "print the search's log on stderr");
  command->progress_lines.add_to(*sub);
  command->flags.add_to(*sub);
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
