/// \file
/// Which plots belong to which experiment.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "evidence/page.hpp"
#include "evidence/plot.hpp"
#include "evidence/table.hpp"
#include "measure/format.hpp"

namespace espalier::cli::evidence {

namespace {

const Axis kTime{"seconds, logarithmic", AxisUnit::seconds, true};

/// The series of that name, made where it is new, so that colours follow the order of first appearance.
Series& series_named(std::vector<Series>& all, const std::string& name) {
  const auto found = std::find_if(all.begin(), all.end(), [&](const Series& s) { return s.name == name; });
  if (found != all.end()) return *found;
  all.push_back({name, {}});
  return all.back();
}

std::size_t row_named(std::vector<std::string>& rows, const std::string& name) {
  const auto found = std::find(rows.begin(), rows.end(), name);
  if (found != rows.end()) return static_cast<std::size_t>(found - rows.begin());
  rows.push_back(name);
  return rows.size() - 1;
}

void sort_points(std::vector<Series>& all) {
  for (Series& s : all)
    std::stable_sort(s.points.begin(), s.points.end(), [](const Point& a, const Point& b) { return a.x < b.x; });
}

/// Systems by rows, solvers by marks.
std::string side_by_side(const Results& results, const std::string& title, const char* phase) {
  DotPlot plot{title, kTime, {}, {}};
  for (const Json& row : results.rows()) {
    Series& series = series_named(plot.series, text(row, "rival"));  // also without figures: one colour in all plots
    const double seconds = median(row, phase);
    if (!solved(row) || !std::isfinite(seconds)) continue;
    const auto at = static_cast<double>(row_named(plot.rows, text(row, "system")));
    series.points.push_back(
        {seconds, at, fmt::format("{}, {}: {}", text(row, "system"), text(row, "rival"), seconds_text(seconds))});
  }
  return svg(plot);
}

/// Solvers by rows, for a table of one system.
std::string by_solver(const Results& results, const std::string& title, const char* phase) {
  DotPlot plot{title, kTime, {}, {{"", {}}}};
  for (const Json& row : results.rows()) {
    const double seconds = median(row, phase);
    if (!solved(row) || !std::isfinite(seconds)) continue;
    const std::string solver = text(row, "rival");
    const auto at = static_cast<double>(row_named(plot.rows, solver));
    plot.series.front().points.push_back({seconds, at, solver + ": " + seconds_text(seconds)});
  }
  return svg(plot);
}

bool one_system(const Results& results) {
  const auto other = [&](const Json& row) { return row.at("system") != results.rows().front().at("system"); };
  return !results.rows().empty() && std::none_of(results.rows().begin(), results.rows().end(), other);
}

/// Ours, the fastest setting of each system.
std::string roofline(const Results& results) {
  DotPlot plot{"Share of the machine's limits", {"share of the limit", AxisUnit::percent, false, true}, {}, {}};
  plot.series = {{"factorization, of our matrix product's rate", {}}, {"solve, of the memory bandwidth", {}}};
  std::map<std::string, const Json*> fastest;  // of ours, by system
  std::vector<std::string> systems;
  for (const Json& row : results.rows()) {
    if (!text(row, "rival").starts_with("espalier") || !std::isfinite(share_of_product(results, row))) continue;
    const auto [at, is_new] = fastest.emplace(text(row, "system"), &row);
    if (is_new) systems.push_back(at->first);
    if (median(row, "refactorization") < median(*at->second, "refactorization")) at->second = &row;
  }
  for (const std::string& system : systems) {
    const Json& row = *fastest[system];
    const auto at = static_cast<double>(row_named(plot.rows, system));
    const double shares[] = {share_of_product(results, row), share_of_bandwidth(results, row)};
    for (std::size_t k = 0; k < 2; ++k)
      if (std::isfinite(shares[k]))
        plot.series[k].points.push_back(
            {shares[k], at, fmt::format("{}, {}: {}", system, text(row, "rival"), percent_text(shares[k]))});
  }
  return svg(plot);
}

std::string peers(const Results& results) {
  return side_by_side(results, "Refactorization", "refactorization") +
         side_by_side(results, "Solve, one right-hand side", "solve_one") +
         side_by_side(results, "Analysis", "analysis") + roofline(results);
}

std::string block_size(const Results& results) {
  LinePlot plot{"Refactorization against the widest block",
                {"widest block, columns", AxisUnit::number, true},
                {"time over the best of the system", AxisUnit::number, false},
                {}};
  std::map<std::string, double> best;
  for (const Json& row : results.rows())
    if (solved(row)) {
      const auto [at, is_new] = best.emplace(text(row, "system"), median(row, "refactorization"));
      if (!is_new) at->second = std::min(at->second, median(row, "refactorization"));
    }
  for (const Json& row : results.rows()) {
    const double width = std::atof(text(row.at("parameters"), "block").c_str());
    if (!solved(row) || !(width > 0)) continue;
    const double ratio = median(row, "refactorization") / best[text(row, "system")];
    series_named(plot.series, text(row, "system"))
        .points.push_back({width, ratio, fmt::format("{}, {:.0f} columns: {:.2f}", text(row, "system"), width, ratio)});
  }
  sort_points(plot.series);
  return svg(plot);
}

std::string memory(const Results& results) {
  LinePlot plot{"Refactorization against the budget of each device",
                {"budget as a share of the need in core", AxisUnit::percent, true},
                kTime,
                {}};
  for (const Json& row : results.rows()) {
    const double share = number(row, {"parameters", "share"});
    if (!solved(row) || !std::isfinite(share)) continue;
    series_named(plot.series, text(row, "system"))
        .points.push_back({share, median(row, "refactorization"),
                           fmt::format("{} at {}: {}", text(row, "system"), percent_text(share),
                                       seconds_text(median(row, "refactorization")))});
  }
  sort_points(plot.series);
  const std::vector<Series> curves = plot.series;
  for (const Json& bound : results.data.value("bounds", Json::array()))
    for (std::size_t k = 0; k < curves.size(); ++k) {
      if (curves[k].name != text(bound, "system") || curves[k].points.empty()) continue;
      const double low = curves[k].points.front().x, high = curves[k].points.back().x;
      for (const auto& [key, name] :
           {std::pair{"in_core_seconds", "in core"}, std::pair{"link_seconds", "factor over the link once"}}) {
        const double seconds = number(bound, key);
        if (!std::isfinite(seconds)) continue;
        const std::string label = fmt::format("{}: {}", curves[k].name, name);
        plot.series.push_back(
            {label, {{low, seconds, label}, {high, seconds, label}}, true, false, true, static_cast<int>(k)});
      }
    }
  return svg(plot);
}

std::string timelines(const Results& results) {
  std::string all;
  for (const Json& one : results.data.value("timelines", Json::array())) {
    TimelinePlot plot{fmt::format("Timeline: {} on {}", text(one, "system"), text(one.at("parameters"), "device")),
                      number(one, "seconds"),
                      {}};
    for (const Json& track : one.at("tracks"))
      plot.tracks.push_back({text(track, "device"), text(track, "device") + ", " + text(track, "name"),
                             track.at("busy").get<std::vector<std::pair<double, double>>>(),
                             track.value("waiting", std::vector<double>{}), number(track, "busy_seconds"),
                             track.value("waiting_seconds", 0.0)});
    for (auto& track : plot.tracks)  // "host device 0 (1 thread), thread 0" is too long for a label
      if (const auto open = track.device.find(" ("); open != std::string::npos)
        track.name = track.device.substr(0, open) + track.name.substr(track.device.size());
    all += svg(plot);
  }
  return all;
}

std::string scaling(const Results& results) {
  LinePlot speed{"Speed-up over one device",
                 {"devices", AxisUnit::number, false, true, true},
                 {"speed-up", AxisUnit::number, false, true},
                 {}};
  LinePlot idle{"Idle and waiting",
                {"devices", AxisUnit::number, false, true, true},
                {"share of the devices' time", AxisUnit::percent, false, true},
                {}};
  double most = 1;
  for (const Json& row : results.rows()) {
    const double devices = number(row, {"parameters", "devices"});
    if (!solved(row) || !text(row, "rival").starts_with("espalier")) continue;
    const std::string system = text(row, "system");
    most = std::max(most, devices);
    series_named(speed.series, system)
        .points.push_back({devices, number(row, "speed_up"),
                           fmt::format("{}, {} devices: {:.2f}", system, devices, number(row, "speed_up"))});
    series_named(idle.series, system)
        .points.push_back(
            {devices, number(row, "idle_fraction"),
             fmt::format("{}, {} devices: {}", system, devices, percent_text(number(row, "idle_fraction")))});
  }
  if (!speed.series.empty())
    speed.series.push_back({"ideal", {{1, 1, "ideal"}, {most, most, "ideal"}}, true, false, true, 7});
  return svg(speed) + svg(idle) + timelines(results);
}

std::string ablation(const Results& results) {
  DotPlot plot{"Refactorization, step by step", kTime, {}, {}};
  for (const Json& row : results.rows()) {
    const std::string step = text(row.at("parameters"), "step"),
                      system = text(row, "system") + " on " + text(row.at("parameters"), "device");
    if (!solved(row)) continue;
    const auto at = static_cast<double>(row_named(plot.rows, step));
    const double seconds = median(row, "refactorization");
    series_named(plot.series, system).points.push_back({seconds, at, system + ": " + seconds_text(seconds)});
  }
  return svg(plot);
}

std::string by_unknowns(const Results& results, const std::string& title, const std::string& y, AxisUnit unit,
                        const std::vector<const char*>& path, bool by_rival) {
  LinePlot plot{title, {"unknowns", AxisUnit::number, true}, {y, unit, true}, {}};
  for (const Json& row : results.rows()) {
    const double value = number(row, path);
    if (!solved(row) || !std::isfinite(value)) continue;
    const std::string family = text(row, "system").substr(0, text(row, "system").find(' '));
    const std::string name = by_rival ? family + ", " + text(row, "rival") : family;
    series_named(plot.series, name)
        .points.push_back({number(row, "unknowns"), value,
                           fmt::format("{}, {}: {:.3g}", text(row, "system"), text(row, "rival"), value)});
  }
  sort_points(plot.series);
  return svg(plot);
}

}  // namespace

std::string plots_of(const Results& results) {
  const std::string experiment = results.experiment();
  if (experiment == "peers") return peers(results);
  if (experiment == "block-size") return block_size(results);
  if (experiment == "memory") return memory(results);
  if (experiment == "scaling") return scaling(results);
  if (experiment == "ablation") return ablation(results) + timelines(results);
  if (experiment == "refactor")
    return one_system(results)
               ? by_solver(results, "Newton step", "newton_step")
               : by_unknowns(results, "Newton step", kTime.label, AxisUnit::seconds, {"newton_step", "median"}, true);
  if (experiment == "growth")
    return by_unknowns(results, "Refactorization", kTime.label, AxisUnit::seconds, {"refactorization", "median"},
                       true) +
           by_unknowns(results, "Memory", "peak memory of the process, logarithmic", AxisUnit::bytes,
                       {"memory", "peak_bytes"}, true) +
           roofline(results);
  if (experiment == "gpu-check")
    return side_by_side(results, "Refactorization", "refactorization") + side_by_side(results, "Solve", "solve_one");
  return roofline(results);
}

}  // namespace espalier::cli::evidence
