#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "evidence/table.hpp"
#include "measure/format.hpp"

namespace espalier::cli::evidence {

namespace {

Cell seconds_cell(double seconds) { return {seconds_text(seconds), seconds}; }
Cell count_cell(double count) { return {count_text(count), count}; }
Cell bytes_cell(double bytes) { return {bytes_text(bytes), bytes}; }
Cell percent_cell(double fraction) { return {percent_text(fraction), fraction}; }
Cell error_cell(double error) { return {error_text(error), error}; }
Cell words(std::string text) { return {std::move(text)}; }

/// Why rows have no figures, or of which run they are; those of one system with one reason share a note.
class Notes {
 public:
  void add(const Json& row, const std::string& reason) {
    if (notes_.empty() || notes_.back().system != text(row, "system") || notes_.back().reason != reason)
      notes_.push_back({text(row, "system"), "", reason});
    notes_.back().names += ", " + text(row, "rival");
  }
  [[nodiscard]] std::vector<std::string> texts() const {
    std::vector<std::string> all;
    for (const Note& note : notes_) all.push_back(fmt::format("{}{}: {}", note.system, note.names, note.reason));
    return all;
  }

 private:
  struct Note {
    std::string system, names, reason;
  };
  std::vector<Note> notes_;
};

/// What the phases and quantities of the file are called.
std::string phase_name(const std::string& key) {
  static const std::map<std::string, std::string> kNames = {{"solve_one", "solve"},
                                                            {"nonzeros_factor", "entries of the factor"},
                                                            {"flops", "operations"},
                                                            {"peak_bytes", "memory"}};
  const auto found = kNames.find(key);
  return found == kNames.end() ? key : found->second;
}

/// The figures that every experiment shows.
struct Figure {
  const char* name;
  Cell (*cell)(const Results&, const Json&);
};

Cell rate_cell(const Results& /*results*/, const Json& row) {
  const double rate = number(row, "flops") / median(row, "refactorization");
  return {rate_text(rate), rate};
}

constexpr Figure kUnknowns{"unknowns", [](const Results&, const Json& r) { return count_cell(number(r, "unknowns")); }};
constexpr Figure kAnalysis{"analysis",
                           [](const Results&, const Json& r) { return seconds_cell(median(r, "analysis")); }};
constexpr Figure kRefactor{"refactorization",
                           [](const Results&, const Json& r) { return seconds_cell(median(r, "refactorization")); }};
constexpr Figure kFirst{"first",
                        [](const Results&, const Json& r) { return seconds_cell(median(r, "first_factorization")); }};
constexpr Figure kLeast{"least", [](const Results&, const Json& r) {
                          return seconds_cell(number(r, {"refactorization", "least"}));
                        }};
constexpr Figure kRate{"rate", rate_cell};
constexpr Figure kShare{"of product",
                        [](const Results& s, const Json& r) { return percent_cell(share_of_product(s, r)); }};
constexpr Figure kSolve{"solve", [](const Results&, const Json& r) { return seconds_cell(median(r, "solve_one")); }};
constexpr Figure kSolveMany{"solve, many",
                            [](const Results&, const Json& r) { return seconds_cell(median(r, "solve_many")); }};
constexpr Figure kStep{"Newton step",
                       [](const Results&, const Json& r) { return seconds_cell(median(r, "newton_step")); }};
constexpr Figure kMemory{"memory", [](const Results&, const Json& r) {
                           return bytes_cell(number(r, {"memory", "peak_bytes"}));
                         }};
constexpr Figure kOnGpu{"on GPU", [](const Results&, const Json& r) {
                          return bytes_cell(number(r, {"memory", "device_bytes"}));
                        }};
constexpr Figure kError{"backward error", [](const Results&, const Json& r) {
                          return error_cell(number(r, {"backward_error", "normwise"}));
                        }};
constexpr Figure kSpeedUp{"speed-up", [](const Results&, const Json& r) {
                            return Cell{factor_text(number(r, "speed_up")), number(r, "speed_up")};
                          }};
constexpr Figure kIdle{"idle", [](const Results&, const Json& r) { return percent_cell(number(r, "idle_fraction")); }};
constexpr Figure kBudget{"budget", [](const Results&, const Json& r) {
                           const double bytes = number(r, {"parameters", "budget_bytes"});
                           return bytes > 0 ? bytes_cell(bytes) : words("none");
                         }};
constexpr Figure kBudgetShare{"of need", [](const Results&, const Json& r) {
                                return percent_cell(number(r, {"parameters", "share"}));
                              }};
constexpr Figure kBlock{"block", [](const Results&, const Json& r) {
                          const std::string block = text(r.at("parameters"), "block");
                          return Cell{block, block == "auto" ? 0 : std::atof(block.c_str())};
                        }};
constexpr Figure kDevice{"device",
                         [](const Results&, const Json& r) { return words(text(r.at("parameters"), "device")); }};
constexpr Figure kShareStep{"step",
                            [](const Results&, const Json& r) { return words(text(r.at("parameters"), "step")); }};

/// Experiments of one solver: the column that tells the rows apart stands in the place of its name.
bool is_of_one_solver(const std::string& experiment) { return experiment == "block-size" || experiment == "ablation"; }

std::vector<Figure> figures_of(const std::string& experiment) {
  if (experiment == "block-size")
    return {kBlock, kUnknowns, kAnalysis, kRefactor, kLeast, kRate, kShare, kSolve, kError};
  if (experiment == "memory")
    return {kDevice, kBudgetShare, kBudget, kRefactor, kLeast, kRate, kSolve, kMemory, kError};
  if (experiment == "scaling")
    return {kUnknowns, kAnalysis, kFirst, kRefactor, kLeast, kRate, kSpeedUp, kIdle, kSolve, kMemory, kError};
  if (experiment == "ablation") return {kShareStep, kDevice, kRefactor, kLeast, kRate, kSpeedUp, kIdle, kError};
  if (experiment == "refactor") return {kUnknowns, kStep, kRefactor, kLeast, kSolve, kMemory, kError};
  if (experiment == "growth") return {kUnknowns, kAnalysis, kRefactor, kRate, kShare, kSolve, kMemory, kError};
  if (experiment == "overhead") return {kUnknowns, kRefactor, kLeast, kSolve, kError};
  return {kUnknowns, kAnalysis, kFirst, kRefactor, kRate, kShare, kSolve, kSolveMany, kMemory, kOnGpu, kError};
}

/// Least median of each system among the rows that are ok.
std::map<std::string, double> best_of(const Results& results, const char* phase) {
  std::map<std::string, double> best;
  for (const Json& row : results.rows()) {
    const double seconds = median(row, phase);
    if (!solved(row) || !std::isfinite(seconds)) continue;
    const auto [at, is_new] = best.emplace(row.at("system"), seconds);
    if (!is_new) at->second = std::min(at->second, seconds);
  }
  return best;
}

/// Columns in which no line has a figure tell nothing.
void drop_column(DataTable& table, std::size_t k) {
  table.columns.erase(table.columns.begin() + static_cast<std::ptrdiff_t>(k));
  for (Line& line : table.lines) line.cells.erase(line.cells.begin() + static_cast<std::ptrdiff_t>(k));
}

void drop_empty(DataTable& table) {
  for (std::size_t k = table.columns.size(); k-- > 2;)
    if (std::all_of(table.lines.begin(), table.lines.end(),
                    [&](const Line& l) { return l.cells[k].text == "-" || l.cells[k].text.empty(); }))
      drop_column(table, k);
}

/// Where nobody is compared, everybody is best.
void drop_best_of_one(DataTable& table) {
  if (std::any_of(table.lines.begin(), table.lines.end(), [](const Line& l) { return !l.best && !l.failed; })) return;
  drop_column(table, table.columns.size() - 1);
  for (Line& line : table.lines) line.best = false;
}

DataTable main_table(const Results& results) {
  const std::string experiment = results.experiment();
  const auto figures = figures_of(experiment);
  const char* decisive = experiment == "refactor" ? "newton_step" : "refactorization";
  const auto best = best_of(results, decisive);
  DataTable table{"All figures", {{"system", true}}};
  const bool one_solver = is_of_one_solver(experiment);
  if (!one_solver) table.columns.push_back({"solver", true});
  for (const Figure& figure : figures) table.columns.push_back({figure.name, figure.name == std::string("step")});
  table.columns.push_back({"times best", false});
  Notes notes;
  std::set<std::string> anchored;
  for (const Json& row : results.rows()) {
    Line line;
    const std::string system = text(row, "system");
    if (anchored.insert(system).second) line.anchor = results.id + "-" + slug(system);
    line.failed = !solved(row);
    line.cells = {words(system)};
    if (!one_solver) line.cells.push_back(words(text(row, "rival")));
    for (const Figure& figure : figures) line.cells.push_back(figure.cell(results, row));
    if (line.failed) line.cells[1].text += " (" + text(row, "outcome") + ")";
    const double ratio = line.failed || !best.contains(system) ? std::nan("") : median(row, decisive) / best.at(system);
    line.best = ratio == 1;
    line.cells.push_back({factor_text(ratio), ratio});
    if (line.failed) notes.add(row, fmt::format("{}: {}", text(row, "outcome"), text(row, "message")));
    if (const auto run = row.find("run"); run != row.end()) {  // scripts/merge_results.py
      line.cells[one_solver ? 0 : 1].text += " †";
      notes.add(row, fmt::format("† of another run, {}, {}: {}", text(*run, "commit"), text(*run, "date"),
                                 text(*run, "command")));
    }
    table.lines.push_back(std::move(line));
  }
  table.notes = notes.texts();
  drop_best_of_one(table);
  drop_empty(table);
  return table;
}

DataTable fits_table(const Json& fits) {
  DataTable table{
      "Fitted exponents",
      {{"family", true}, {"solver", true}, {"quantity", true}, {"exponent of n"}, {"theory"}, {"r²"}, {"points"}}};
  for (const Json& fit : fits) {
    const double theory = number(fit, "theory");
    table.lines.push_back({"",
                           {words(text(fit, "family")),
                            words(text(fit, "rival")),
                            words(phase_name(text(fit, "quantity"))),
                            {factor_text(number(fit, "exponent")), number(fit, "exponent")},
                            {std::isfinite(theory) ? fmt::format("{:.3g}", theory) : "-", theory},
                            {fmt::format("{:.3f}", number(fit, "r_squared")), number(fit, "r_squared")},
                            count_cell(number(fit, "points"))}});
  }
  return table;
}

DataTable overhead_table(const Json& overhead) {
  DataTable table{"Overhead", {{"system", true}, {"phase", true}, {"of medians"}, {"standard error"}, {"of least"}}};
  for (const Json& one : overhead)
    table.lines.push_back(
        {"",
         {words(text(one, "system")), words(phase_name(text(one, "phase"))), percent_cell(number(one, "of_medians")),
          percent_cell(number(one, "error")), percent_cell(number(one, "of_least"))}});
  return table;
}

DataTable ceilings_table(const Json& ceilings) {
  DataTable table{"Limits of this machine", {{"limit", true}, {"where", true}, {"rate"}}};
  const auto add = [&](const std::string& name, const std::string& where, double value, const char* unit) {
    if (std::isfinite(value))
      table.lines.push_back({"", {words(name), words(where), {fmt::format("{:.4g} {}", value, unit), value}}});
  };
  const std::string threads = text(ceilings, "threads") + " threads";
  add("matrix product, FP64 (ours)", "one thread", number(ceilings, "gemm_flops_per_second_one_thread") * 1e-9,
      "GFLOP/s");
  add("matrix product, FP64 (ours)", threads, number(ceilings, "gemm_flops_per_second") * 1e-9, "GFLOP/s");
  add("main memory, read", threads, number(ceilings, {"memory", "read_bytes_per_second", "best"}) * 1e-9, "GB/s");
  add("main memory, triad", threads, number(ceilings, {"memory", "triad_bytes_per_second", "best"}) * 1e-9, "GB/s");
  int place = 0;
  for (const Json& gpu : ceilings.value("gpus", Json::array())) {
    const std::string where = fmt::format("{} #{}", text(gpu, "name"), place++);
    add("matrix product, FP64 (cuBLAS)", where, number(gpu, "gemm_flops_per_second") * 1e-12, "TFLOP/s");
    add("FP64 by data sheet", where, number(gpu, "data_sheet_flops_per_second") * 1e-12, "TFLOP/s");
    add("device memory", where, number(gpu, "memory_bytes_per_second") * 1e-9, "GB/s");
    add("host to device, pinned", where, number(gpu, "host_to_device_bytes_per_second") * 1e-9, "GB/s");
    add("device to host, pinned", where, number(gpu, "device_to_host_bytes_per_second") * 1e-9, "GB/s");
    int peer = 0;
    for (const Json& link : gpu.value("to_peers_bytes_per_second", Json::array())) {
      if (link.is_number()) add(fmt::format("to GPU #{}", peer), where, link.get<double>() * 1e-9, "GB/s");
      ++peer;
    }
  }
  return table;
}

}  // namespace

double share_of_product(const Results& results, const Json& row) {
  const auto ceilings = results.data.find("ceilings");
  if (ceilings == results.data.end() || !solved(row)) return std::nan("");
  double limit = number(*ceilings, "gemm_flops_per_second");
  if (text(row, "rival").find("gpu") != std::string::npos || text(row, "rival").starts_with("cudss")) {
    const Json gpus = ceilings->value("gpus", Json::array());
    if (gpus.empty()) return std::nan("");
    limit = number(gpus[0], "gemm_flops_per_second");
    if (!std::isfinite(limit)) limit = number(gpus[0], "data_sheet_flops_per_second");
  }
  return number(row, "flops") / median(row, "refactorization") / limit;
}

double share_of_bandwidth(const Results& results, const Json& row) {
  const auto ceilings = results.data.find("ceilings");
  if (ceilings == results.data.end() || !solved(row)) return std::nan("");
  double limit = number(*ceilings, {"memory", "read_bytes_per_second", "best"});
  if (text(row, "rival").find("gpu") != std::string::npos) {
    const Json gpus = ceilings->value("gpus", Json::array());
    limit = gpus.empty() ? std::nan("") : number(gpus[0], "memory_bytes_per_second");
  }
  return 2 * 8 * number(row, "nonzeros_factor") / median(row, "solve_one") / limit;
}

std::vector<DataTable> tables_of(const Results& results) {
  std::vector<DataTable> tables;
  if (!results.rows().empty()) tables.push_back(main_table(results));
  if (results.data.contains("fits") && !results.data["fits"].empty())
    tables.push_back(fits_table(results.data["fits"]));
  if (results.data.contains("overhead")) tables.push_back(overhead_table(results.data["overhead"]));
  if (results.data.contains("ceilings")) {
    tables.push_back(ceilings_table(results.data["ceilings"]));
    tables.back().aside = tables.size() > 1;
  }
  return tables;
}

}  // namespace espalier::cli::evidence
