// Solves every matrix file under a folder with default options and prints one Markdown row for each: what it is, how
// the call ended, backward errors judged by an independent residual, inertia beside the expected one where a .json file
// tells it.
//   espalier_collection FOLDER [--device cpu|gpu:0|host:2|...] [--device-memory SIZE]
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/read.hpp"
#include "matrix/residual.hpp"
#include "solver/options/option_text.hpp"

namespace {

using namespace espalier;
namespace fs = std::filesystem;

constexpr double kWantedBackwardError = 1e-14;

bool is_matrix(const fs::path& p) {
  const std::string name = p.filename().string();
  return name.ends_with(".mtx") || name.ends_with(".mtx.gz") || name.ends_with(".rb");
}

std::string expected_inertia(const fs::path& p) {
  fs::path json = p;
  json.replace_extension(".json");
  std::ifstream in(json);
  if (!in) return "";
  const auto j = nlohmann::json::parse(in, nullptr, false);
  if (j.is_discarded() || !j.contains("inertia")) return "";
  const auto& i = j["inertia"];
  return fmt::format("{} {} {}", i.value("positive", -1), i.value("negative", -1), i.value("zero", -1));
}

struct Row {
  std::string name, kind, outcome, inertia, expected, message;
  Index n = 0;
  Offset nonzeros = 0;
  double normwise = 0, componentwise = 0;
  Index delayed = 0;
  bool good = false;  // solved to the wanted accuracy, or refused with a reason
};

Row run(const fs::path& path, const fs::path& folder, const Options& options) {
  Row row;
  row.name = fs::relative(path, folder).string();
  row.expected = expected_inertia(path);
  SparseMatrix a;
  try {
    a = matrix::read_matrix(path.string());
  } catch (const Error& e) {
    row.outcome = "unreadable";
    row.message = e.what();
    row.good = true;
    return row;
  }
  row.n = a.rows;
  row.nonzeros = a.nonzeros();
  Solver solver(options);
  const AnalysisResult analysis = solver.analyze(a);
  Status status = analysis.status;
  row.kind = std::string(solver::name_of(analysis.kind));
  FactorResult factor;
  if (status.ok()) {
    factor = solver.factorize(a);
    status = factor.status;
    row.kind = std::string(solver::name_of(solver.analysis().kind));
    row.inertia = fmt::format("{} {} {}", factor.inertia.positive, factor.inertia.negative, factor.inertia.zero);
    row.delayed = factor.delayed;
  }
  if (status.ok()) {
    const std::vector<double> b(static_cast<std::size_t>(a.rows), 1.0);
    std::vector<double> x(b.size());
    status = solver.solve(b, x).status;
    const matrix::BackwardErrors errors = matrix::backward_errors(a, x, b);
    row.normwise = errors.normwise;
    row.componentwise = errors.componentwise;
  }
  row.outcome = std::string(solver::name_of(status.code));
  row.message = status.message;
  row.good = status.ok() ? row.normwise <= kWantedBackwardError
                         : status.code != StatusCode::accuracy_not_reached && !status.message.empty();
  return row;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Solves every matrix file under a folder; prints one Markdown row for each"};
  std::string folder, device_memory;
  Options options;
  app.add_option("folder", folder, "searched with all its folders")->required()->check(CLI::ExistingDirectory);
  app.add_option("--device", options.device, "as for espalier solve")->capture_default_str();
  app.add_option("--device-memory", device_memory, "budget of the device, as for espalier solve");
  CLI11_PARSE(app, argc, argv);
  if (!device_memory.empty()) options.device_memory_bytes = solver::parse_bytes(device_memory);
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && is_matrix(entry.path())) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  fmt::print(
      "| matrix | n | stored | kind | outcome | normwise | componentwise | inertia + - 0 | expected | moved pivots |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n");
  std::size_t good = 0, inertia_same = 0, inertia_known = 0;
  std::vector<std::string> notes;
  for (const auto& file : files) {
    const Row r = run(file, folder, options);
    good += r.good ? 1 : 0;
    if (!r.expected.empty() && !r.inertia.empty()) {
      ++inertia_known;
      inertia_same += r.expected == r.inertia ? 1 : 0;
    }
    fmt::print("| {} | {} | {} | {} | {} | {:.1e} | {:.1e} | {} | {} | {} |\n", r.name, r.n, r.nonzeros, r.kind,
               r.outcome, r.normwise, r.componentwise, r.inertia, r.expected, r.delayed);
    std::fflush(stdout);
    if (!r.message.empty()) notes.push_back(fmt::format("- {}: {}", r.name, r.message));
  }
  fmt::print(
      "\n{} of {} solved with a normwise backward error of at most {:.0e} or refused with a reason; inertia as "
      "expected in {} of "
      "{}\n\n",
      good, files.size(), kWantedBackwardError, inertia_same, inertia_known);
  for (const auto& n : notes) fmt::print("{}\n", n);
  return good == files.size() ? 0 : 1;
}
