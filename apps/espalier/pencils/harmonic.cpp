/// \file
/// `espalier harmonic`: amplitudes and phases of (K (1 + i eta) + i w C - w^2 M) x = f over a range of frequencies.
#include "espalier/harmonic.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/input.hpp"
#include "common/progress.hpp"
#include "common/solver_flags.hpp"
#include "common/stop_signals.hpp"
#include "common/terminal.hpp"
#include "harmonic/table.hpp"
#include "matrix/read.hpp"
#include "pencils/pencil_command.hpp"
#include "pencils/pencil_pages.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {

namespace {

using Json = nlohmann::ordered_json;
using Complex = std::complex<double>;

struct HarmonicCommand {
  std::string k_file, m_file, damping_file, load_file, at, observe, frequencies, csv_file, report_file, page_file;
  HarmonicOptions options;
  SolverFlags flags;
  ProgressLines::Options progress_lines;
  bool json = false, quiet = false, verbose = false, no_modes = false;

  int run();
  [[nodiscard]] std::vector<Complex> loads(Index n, base::ThreadPool& pool) const;
};

std::vector<Complex> HarmonicCommand::loads(Index n, base::ThreadPool& pool) const {
  if (load_file.empty() == at.empty())
    throw Error(StatusCode::invalid_input, "give the loads, either --load FILE or --at 0,5 (unit loads on unknowns)");
  if (!load_file.empty()) return read_complex_columns(load_file, n, pool).values;
  const std::vector<Index> unknowns = parse_unknowns(at, n);
  const auto rows = static_cast<std::size_t>(n);
  std::vector<Complex> f(rows * unknowns.size());
  for (std::size_t c = 0; c < unknowns.size(); ++c) {
    f[c * rows + static_cast<std::size_t>(unknowns[c])] = 1;
  }
  return f;
}

Index unknown_of(const HarmonicOptions& o, Index output) {
  return o.observed.empty() ? output : o.observed[static_cast<std::size_t>(output)];
}

void write_csv(const std::string& path, const HarmonicOptions& o, const HarmonicResult& r) {
  std::vector<std::string> outputs, loads;
  for (Index i = 0; i < r.outputs; ++i) outputs.push_back(fmt::format("{}", unknown_of(o, i)));
  for (Index l = 0; l < r.loads; ++l) loads.push_back(fmt::format("{}", l));
  base::OutputFile file(path);
  harmonic::write_table(r, outputs, loads, [&](std::string_view line) { file.write(line); });
  file.commit();
}

Json report_of(const HarmonicOptions& o, const HarmonicResult& r, int code) {
  Json points = Json::array(), resonances = Json::array(), highest = Json::array();
  for (const HarmonicPoint& p : r.points) {
    Json point = {{"frequency", p.frequency}, {"solved", p.solved}};
    if (!std::isnan(p.backward_error)) point["backward_error"] = p.backward_error;
    if (!p.solved && std::isfinite(p.error_estimate)) point["error_estimate"] = p.error_estimate;
    if (!p.status.ok()) point["message"] = p.status.message;
    points.push_back(std::move(point));
  }
  for (const HarmonicResonance& x : r.resonances)
    resonances.push_back({{"frequency", x.frequency}, {"half_width", x.half_width}, {"excited", x.excited}});
  for (const harmonic::Peak& h : harmonic::highest(r))
    highest.push_back({{"load", h.load},
                       {"unknown", unknown_of(o, h.output)},
                       {"frequency", h.frequency},
                       {"amplitude", h.amplitude},
                       {"phase", h.phase}});
  const HarmonicSeconds& s = r.seconds;
  return {{"espalier", solver::version()},
          {"exit_code", code},
          {"message", r.status.message},
          {"unknowns", r.n},
          {"loads", r.loads},
          {"points", points},
          {"highest", highest},
          {"resonances", resonances},
          {"complete", r.complete},
          {"completeness", r.completeness},
          {"checks", r.checks},
          {"checked_error", std::isfinite(r.checked_error) ? Json(r.checked_error) : Json()},
          {"factorizations", r.factorizations},
          {"solved_columns", r.solved_columns},
          {"seconds",
           {{"total", s.total},
            {"modes", s.modes},
            {"analysis", s.analysis},
            {"factorization", s.factorization},
            {"solves", s.solves},
            {"interpolation", s.interpolation}}}};
}

std::string summary_of(const HarmonicOptions& o, const HarmonicResult& r) {
  constexpr std::size_t kRows = 20;
  Table peaks(">>>>>");
  peaks.add({"load", "unknown", "frequency", "amplitude", "phase"}, Tone::quiet);
  const std::vector<harmonic::Peak> all = harmonic::highest(r);
  for (std::size_t i = 0; i < std::min(kRows, all.size()); ++i)
    peaks.add({fmt::format("{}", all[i].load), fmt::format("{}", unknown_of(o, all[i].output)),
               fmt::format("{:.9g}", all[i].frequency), fmt::format("{:.6g}", all[i].amplitude),
               fmt::format("{:.2f}", all[i].phase)});
  std::string text = "  highest amplitudes (phases in degrees)\n" + peaks.text();
  if (all.size() > kRows)
    text += fmt::format("  and {} more; --observe and --csv choose and write them\n", all.size() - kRows);
  double worst = 0;
  for (const HarmonicPoint& p : r.points)
    if (p.solved && p.backward_error > worst) worst = p.backward_error;
  const HarmonicSeconds& s = r.seconds;
  Table cost("<<");
  cost.add({"unknowns", grouped(r.n)});
  cost.add({"points",
            fmt::format("{}, {} solved, backward errors to {}", grouped(static_cast<std::int64_t>(r.points.size())),
                        grouped(r.factorizations), small(worst))});
  cost.add({"time", fmt::format("{}: modes {}, analysis {}, factorizations {}, solves {}, interpolation {}",
                                duration(s.total), duration(s.modes), duration(s.analysis), duration(s.factorization),
                                duration(s.solves), duration(s.interpolation))});
  if (o.tolerance > 0) {
    cost.add({"checked", fmt::format("the last {} of {} solves held back agree to {}", std::min<Index>(4, r.checks),
                                     r.checks, small(r.checked_error))});
    cost.add({"resonances",
              fmt::format("{}; {}", r.resonances.size(), r.complete ? "all: " + r.completeness : r.completeness)});
  }
  return text + "\n" + cost.text();
}

int HarmonicCommand::run() {
  refuse_chosen_flags(flags, "the sweep chooses");
  options.solver = flags.options();
  options.seek_resonances = !no_modes;
  check_outputs({{"K", k_file}, {"M", m_file}, {"--damping", damping_file}, {"--load", load_file}},
                {{"--csv", csv_file}, {"--report", report_file}, {"--page", page_file}});
  if (verbose) options.solver.log = [](const std::string& line) { print_note("{}\n", line); };
  options.solver.interrupted = stop_was_asked;
  Progress progress(!quiet && !json, "harmonic", progress_lines);
  progress.begin("reading");
  base::ThreadPool pool(options.solver.threads > 0 ? options.solver.threads : base::available_cores());
  const matrix::ReadOptions from_file = reading(pool, quiet || json);
  const SparseMatrix k = matrix::read_matrix(k_file, from_file), m = matrix::read_matrix(m_file, from_file);
  SparseMatrix c;
  if (!damping_file.empty()) c = matrix::read_matrix(damping_file, from_file);
  if (!observe.empty()) options.observed = parse_unknowns(observe, k.rows);
  const std::vector<Complex> f = loads(k.rows, pool);
  progress.end("");
  progress.begin("frequency response");
  HarmonicResult r;
  {
    const StopSignals signals;
    r = harmonic_response(k, c, m, f, k.rows > 0 ? static_cast<Index>(f.size() / static_cast<std::size_t>(k.rows)) : 0,
                          options);
  }
  if (r.status.ok())
    progress.end(fmt::format("{} in {}", counted(static_cast<Index>(r.points.size()), "point", "points"),
                             duration(r.seconds.total)));
  progress.abandon();
  const auto files = [&] {
    if (!csv_file.empty() && !r.points.empty()) write_csv(csv_file, options, r);
  };
  return conclude(
      {json, quiet, report_file, page_file}, r.status, [&](int code) { return report_of(options, r, code); }, files,
      [&](const Json& report) { return harmonic_sheet(k_file, options, r, report); },
      r.points.empty() ? "" : summary_of(options, r));
}

}  // namespace

void add_harmonic(CLI::App& app, Action& action) {
  auto command = std::make_shared<HarmonicCommand>();
  HarmonicOptions& o = command->options;
  CLI::App* sub = app.add_subcommand("harmonic", "Frequency response of K + i w C - w^2 M (docs/use/harmonic.md)");
  add_file(*sub, "K", command->k_file, "the stiffness: Matrix Market or Rutherford-Boeing, also .gz")->required();
  add_file(*sub, "M", command->m_file, "the mass")->required();
  add_file(*sub, "--damping", command->damping_file, "C, viscous damping");
  sub->add_option("--loss-factor", o.loss_factor, "eta of K (1 + i eta), structural damping (default 0)")
      ->type_name("ETA")
      ->check(not_negative());
  add_file(*sub, "--load", command->load_file, "loads: Matrix Market, real or complex, one column each");
  sub->add_option("--at", command->at, "unit loads on these unknowns, each a load of its own: 0,5,10-20")
      ->type_name("LIST");
  sub->add_option("--observe", command->observe, "unknowns whose responses are given: 0,5,10-20 (default: all)")
      ->type_name("LIST");
  sub->add_option("--from", o.from, "lowest frequency, cycles per unit of time")
      ->type_name("F")
      ->required()
      ->check(not_negative());
  sub->add_option("--to", o.to, "highest frequency")->type_name("F")->required()->check(positive());
  sub->add_option("--points", o.points, "so many frequencies, both ends included (default 101)")->type_name("N");
  sub->add_flag("--logarithmic", o.logarithmic, "equal ratios of frequencies instead of equal steps");
  sub->add_option("--tolerance", o.tolerance,
                  "solve at chosen frequencies alone and interpolate to this relative error")
      ->type_name("T")
      ->check(positive());
  sub->add_option("--max-solves", o.max_solves, "most frequencies solved for --tolerance (default 1000)")
      ->type_name("N");
  sub->add_flag("--no-modes", command->no_modes, "with --tolerance: do not look for the modes first");
  add_file(*sub, "--csv", command->csv_file, "write amplitudes and phases (degrees) here");
  add_file(*sub, "--report", command->report_file, "write the report as JSON here");
  add_page(*sub, command->page_file, "harmonic.html");
  sub->add_flag("--json", command->json, "print the report as JSON instead of the table");
  sub->add_flag("-q,--quiet", command->quiet, "print nothing but errors");
  sub->add_flag("-v,--verbose", command->verbose, "print the log on stderr");
  command->progress_lines.add_to(*sub);
  command->flags.add_to(*sub);
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
