#include "pencils/model_modes.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/terminal.hpp"
#include "pencils/pencil_pages.hpp"
#include "solve/report.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {

namespace {

using Json = nlohmann::ordered_json;

struct Sweep {
  std::string number;
  std::vector<double> values;
};

/// "0:600:20", the last number the step; or one value.
std::vector<double> values_of(const std::string& text, const char* option) {
  constexpr double kMost = 10000;
  std::vector<double> parts;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(':', at), text.size());
    double value = 0;
    const auto [rest, error] = std::from_chars(text.data() + at, text.data() + end, value);
    if (error != std::errc() || rest != text.data() + end || !std::isfinite(value))
      throw Error(StatusCode::invalid_input, fmt::format("{} {}: give BEGIN:END:STEP, three numbers", option, text));
    parts.push_back(value);
    at = end + 1;
  }
  if (parts.size() == 1) return parts;
  if (parts.size() != 3 || parts[2] == 0 || (parts[1] - parts[0]) / parts[2] < 0)
    throw Error(StatusCode::invalid_input,
                fmt::format("{} {}: give BEGIN:END:STEP, with a step that leads from BEGIN to END", option, text));
  const double steps = (parts[1] - parts[0]) / parts[2];
  if (steps > kMost) throw Error(StatusCode::invalid_input, fmt::format("{} {}: too many values", option, text));
  std::vector<double> values;
  for (double k = 0; k <= steps * (1 + 1e-12); ++k) values.push_back(parts[0] + k * parts[2]);
  return values;
}

Sweep sweep_of(const ModelModesCommand& c) {
  if (c.speeds.empty() && c.over.empty()) return {"", {0}};  // the model as it is
  if (!c.speeds.empty() && !c.over.empty())
    throw Error(StatusCode::invalid_input,
                "modes of a model: give --speeds BEGIN:END:STEP, of its [initial] rotation, or --over "
                "PATH=BEGIN:END:STEP, of another number; not both");
  if (!c.speeds.empty()) return {"initial.rotation.speed", values_of(c.speeds, "--speeds")};
  const std::size_t equals = c.over.find('=');
  if (equals == std::string::npos || equals == 0)
    throw Error(StatusCode::invalid_input, fmt::format("--over {}: give PATH=BEGIN:END:STEP", c.over));
  return {c.over.substr(0, equals), values_of(c.over.substr(equals + 1), "--over")};
}

std::string direction(const SimulationMode& m) {
  constexpr double kLine = 0.05;
  if (std::abs(m.whirl) < kLine) return "-";
  return fmt::format("{} {:.2f}", m.whirl > 0 ? "forward" : "backward", std::abs(m.whirl));
}

std::string table_of(const ModelModesResult& r) {
  const bool sweep = !r.number.empty();
  Table table(sweep ? ">>>>>>>" : ">>>>>>");
  std::vector<std::string> head = {r.number, "mode", "frequency", "damping", "growth", "whirl", "standing"};
  table.add({head.begin() + (sweep ? 0 : 1), head.end()}, Tone::quiet);
  for (const ModelModesPoint& p : r.points)
    for (std::size_t k = 0; k < p.modes.size(); ++k) {
      const SimulationMode& m = p.modes[k];
      const std::vector<std::string> row = {
          fmt::format("{:.6g}", p.value),
          fmt::format("{}", k + 1),
          fmt::format("{:.9g}", m.frequency),
          fmt::format("{:.4g}", m.damping_ratio + 0.0),  // no -0
          fmt::format("{:.9g}", m.growth + 0.0),
          direction(m),
          std::isnan(m.standing_frequency) ? "-" : fmt::format("{:.9g}", m.standing_frequency)};
      table.add({row.begin() + (sweep ? 0 : 1), row.end()});
    }
  return table.text();
}

Json report_of(const ModelModesResult& r, int code) {
  Json points = Json::array();
  for (const ModelModesPoint& p : r.points) {
    Json modes = Json::array();
    for (const SimulationMode& m : p.modes) {
      Json mode = {
          {"frequency", m.frequency}, {"damping_ratio", m.damping_ratio}, {"growth", m.growth}, {"whirl", m.whirl}};
      if (!std::isnan(m.standing_frequency)) mode["standing_frequency"] = m.standing_frequency;
      modes.push_back(std::move(mode));
    }
    points.push_back({{"value", p.value}, {"modes", modes}, {"notices", p.notices}});
  }
  return {{"espalier", solver::version()},
          {"exit_code", code},
          {"message", r.status.message},
          {"number", r.number},
          {"points", points}};
}

}  // namespace

int run_model_modes(const ModelModesCommand& command, Progress& progress) {
  const Sweep sweep = sweep_of(command);
  progress.begin("modes");
  const ModelModesResult r = model_modes(command.model, sweep.number, sweep.values, command.count, command.options);
  progress.abandon();
  const auto files = [&] {
    if (command.csv_file.empty() || r.points.empty()) return;
    base::OutputFile file(command.csv_file);
    file.write(modes_table(r));
    file.commit();
  };
  if (!command.output.quiet && !command.output.json && !r.points.empty())
    for (const std::string& notice : r.points.front().notices) print_note("espalier: {}\n", notice);
  if (!command.output.quiet && r.status.ok() && !r.points.empty() && r.points.front().modes.empty())
    print_note("espalier: the model has no degrees of freedom, and no modes\n");
  return conclude(
      command.output, r.status, [&](int code) { return report_of(r, code); }, files,
      [&](const Json& report) { return model_modes_sheet(command.model, r, report); },
      r.points.empty() ? "" : table_of(r));
}

}  // namespace espalier::cli
