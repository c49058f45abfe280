#include "solve/solve_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <system_error>

#include "common/terminal.hpp"
#include "matrix/file.hpp"
#include "solver/options/option_text.hpp"
#include "solver/session/solver_impl.hpp"

namespace espalier::cli {

namespace {

std::string said_of(const Spy& spy, Index rows, const char* order) {
  return fmt::format("{} rows, {} entries, {}", grouped(rows), grouped(spy.entries), order);
}

/// How busy each thread was in each part of the time of a trace; null where there is none, or it is too long to read.
nlohmann::ordered_json timeline_of(const std::string& file) {
  constexpr int kParts = 200;
  constexpr std::uintmax_t kMostBytes = 100'000'000;
  std::error_code absent;
  if (const auto bytes = std::filesystem::file_size(file, absent); absent || bytes > kMostBytes) return nullptr;
  const auto trace = nlohmann::json::parse(matrix::FileBytes(file).bytes(), nullptr, false);
  if (trace.is_discarded()) return nullptr;
  std::map<int, std::string> devices, names;  // by process and by thread number
  double end = 0;
  for (const auto& event : trace.at("traceEvents")) {
    if (event.at("ph") == "X") end = std::max(end, event.at("ts").get<double>() + event.at("dur").get<double>());
    if (event.at("ph") != "M") continue;
    const std::string name = event.at("args").at("name");
    if (event.at("name") == "process_name") devices[event.at("pid")] = name;
    if (event.at("name") == "thread_name") names[event.at("tid")] = devices[event.at("pid")] + ", " + name;
  }
  std::map<int, std::vector<double>> busy;
  for (const auto& [thread, name] : names) busy[thread].assign(kParts, 0);
  for (const auto& event : trace.at("traceEvents")) {
    if (event.at("ph") != "X" || end <= 0) continue;
    const double from = event.at("ts").get<double>() / end * kParts;
    const double to = from + event.at("dur").get<double>() / end * kParts;
    for (int part = static_cast<int>(from); part < kParts && part < to; ++part)
      busy[event.at("tid")].at(static_cast<std::size_t>(part)) +=
          std::max(0.0, std::min<double>(to, part + 1) - std::max<double>(from, part));
  }
  nlohmann::ordered_json tracks = nlohmann::ordered_json::array();
  for (auto& [thread, shares] : busy) {
    double sum = 0;
    for (double& share : shares) sum += share = std::min(1.0, share);
    tracks.push_back({{"name", names[thread]}, {"share", sum / kParts}, {"busy", shares}});
  }
  return {{"seconds", end * 1e-6}, {"tracks", std::move(tracks)}};
}

}  // namespace

void take_order(SolvePictures& pictures, const MatrixView& pattern, Solver& solver) {
  const solver::Session& session = solver::SolverAccess::session(solver);
  if (!session.factor) return;
  const solver::Analysis& analysis = session.current();
  const std::vector<Index>& order = analysis.plan.tree.order;
  const std::vector<Index>& row_of_col = analysis.system->prepared.row_of_col;
  const auto n = static_cast<std::size_t>(pattern.rows);
  if (order.size() != n) return;
  std::vector<Index> column(n), row(n);
  for (std::size_t k = 0; k < n; ++k) column[static_cast<std::size_t>(order[k])] = static_cast<Index>(k);
  // An unsymmetric matrix has the rows on its diagonal that the matching chose.
  row = column;
  for (std::size_t c = 0; c < row_of_col.size(); ++c) row[static_cast<std::size_t>(row_of_col[c])] = column[c];
  pictures.ordered = spy_of(pattern, row, column);
}

Sheet solve_sheet(const RunRecord& record, nlohmann::ordered_json report, const SolvePictures& pictures,
                  const std::string& trace_file) {
  report["tree"] = to_json(pictures.tiers);
  Sheet sheet(record.input.empty() ? "solve" : record.input, std::move(report));
  sheet.set_facts(fmt::format("{} unknowns, {} entries{}", grouped(record.rows), grouped(record.nonzeros),
                              record.analysis ? ", " + std::string(solver::name_of(record.analysis->kind)) : ""));
  if (pictures.given.size > 0)
    sheet.add_picture("The matrix as it is given", pictures.given.size, pictures.given.counts,
                      said_of(pictures.given, record.rows, "as they are given"));
  if (pictures.ordered)
    sheet.add_picture("The matrix in the order of elimination", pictures.ordered->size, pictures.ordered->counts,
                      said_of(*pictures.ordered, record.rows, "in the order of elimination: separators come last"));
  if (!pictures.tiers.empty()) {
    std::vector<double> tier, flops, largest, fronts;
    for (const Solver::TierRow& t : pictures.tiers) {
      tier.push_back(t.tier);
      flops.push_back(t.flops);
      largest.push_back(t.largest_front);
      fronts.push_back(t.fronts);
    }
    sheet.begin_plot("The elimination tree: work by tier, from the root to the leaves", {"tier"}, {"FLOP", true},
                     "bars");
    sheet.add_series("FLOP", tier, flops);
    sheet.begin_plot("Fronts by tier", {"tier"}, {"number, rows", true}, "line");
    sheet.add_series("fronts", tier, fronts);
    sheet.add_series("rows of the largest front", tier, largest);
  }
  try {
    if (!trace_file.empty() && record.status.ok()) sheet.set_timeline(timeline_of(trace_file));
  } catch (const Error& error) {
    print_note("espalier: the page has no timeline: {}\n", error.what());
  }
  return sheet;
}

}  // namespace espalier::cli
