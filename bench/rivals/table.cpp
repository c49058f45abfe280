#include "rivals/table.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace espalier::bench {
namespace {

std::string seconds_text(double seconds) {
  if (!std::isfinite(seconds)) return "-";
  if (seconds < 1e-3) return fmt::format("{:.3g} us", seconds * 1e6);
  if (seconds < 1) return fmt::format("{:.3g} ms", seconds * 1e3);
  return fmt::format("{:.3g} s", seconds);
}

std::string count_text(double count) { return count < 0 ? "-" : fmt::format("{:.3g}", count); }

std::string bytes_text(Offset bytes) {
  return bytes < 0 ? "-" : fmt::format("{:.3g} GB", static_cast<double>(bytes) * 1e-9);
}

std::string rate_text(const Row& row) {
  const double seconds = row.refactorization.median();
  return row.flops > 0 && seconds > 0 ? fmt::format("{:.3g}", row.flops / seconds * 1e-9) : "-";
}

/// Least median refactorization of all rows that are ok.
double best_of(const std::vector<Row>& rows) {
  double best = std::numeric_limits<double>::infinity();
  for (const Row& row : rows)
    if (row.verdict.ok() && !row.refactorization.empty()) best = std::min(best, row.refactorization.median());
  return best;
}

std::vector<std::string> cells(const Row& row, double best) {
  const double seconds = row.refactorization.median();
  return {row.spec,
          seconds_text(row.analysis.median()),
          seconds_text(row.first_factorization.median()),
          seconds_text(seconds),
          std::isfinite(seconds) && row.verdict.ok() ? fmt::format("{:.2f}", seconds / best) : "-",
          rate_text(row),
          seconds_text(row.solve_one.median()),
          seconds_text(row.solve_many.median()),
          count_text(static_cast<double>(row.nonzeros_factor)),
          count_text(row.flops),
          bytes_text(row.peak_bytes),
          bytes_text(row.device_bytes),
          row.solve_one.empty() ? "-" : fmt::format("{:.1e}", row.error.normwise)};
}

/// Null for what is not known, so that nobody takes -1 for a figure.
template <typename T>
nlohmann::json known(T value) {
  return value < 0 ? nlohmann::json(nullptr) : nlohmann::json(value);
}

}  // namespace

std::string text_table(const std::vector<Row>& rows, Index columns) {
  std::vector<std::vector<std::string>> lines = {{"rival", "analysis", "first", "refactor", "x best", "GFLOP/s",
                                                  "solve 1", fmt::format("solve {}", columns), "nnz(L)", "flops",
                                                  "memory", "on GPU", "backward"}};
  const double best = best_of(rows);
  for (const Row& row : rows) lines.push_back(cells(row, best));
  constexpr std::ptrdiff_t kMany = 7;  // the column of the second solve
  for (auto& line : lines)
    if (columns == 1) line.erase(line.begin() + kMany);
  std::vector<std::size_t> widths(lines.front().size(), 0);
  for (const auto& line : lines)
    for (std::size_t k = 0; k < line.size(); ++k) widths[k] = std::max(widths[k], line[k].size());
  std::string text;
  for (std::size_t at = 0; at < lines.size(); ++at) {
    text += fmt::format("{:<{}}", lines[at][0], widths[0]);
    for (std::size_t k = 1; k < lines[at].size(); ++k) text += fmt::format("  {:>{}}", lines[at][k], widths[k]);
    text += '\n';
    if (at == 0) continue;
    const Verdict& verdict = rows[at - 1].verdict;
    if (!verdict.ok())
      text += fmt::format("  ^ {}: {}\n", nlohmann::json(verdict.outcome).get<std::string>(), verdict.message);
  }
  return text;
}

nlohmann::json samples_record(const Samples& samples) {
  if (samples.empty()) return nullptr;
  return {{"median", samples.median()}, {"least", samples.least()}, {"seconds", samples.seconds}};
}

nlohmann::json row_record(const Row& row) {
  return {{"rival", row.spec},
          {"version", row.version},
          {"outcome", row.verdict.outcome},
          {"message", row.verdict.message},
          {"analysis", samples_record(row.analysis)},
          {"first_factorization", samples_record(row.first_factorization)},
          {"refactorization", samples_record(row.refactorization)},
          {"solve_one", samples_record(row.solve_one)},
          {"solve_many", samples_record(row.solve_many)},
          {"nonzeros_factor", known(row.nonzeros_factor)},
          {"flops", known(row.flops)},
          {"inertia", row.inertia.positive < 0 ? nlohmann::json(nullptr) : nlohmann::json(row.inertia)},
          {"perturbed", known(row.perturbed)},
          {"refinement_steps", known(row.refinement_steps)},
          {"backward_error",
           row.checked ? nlohmann::json{{"normwise", row.error.normwise}, {"componentwise", row.error.componentwise}}
                       : nlohmann::json(nullptr)},
          {"memory",
           {{"peak_bytes", known(row.peak_bytes)},
            {"device_bytes", known(row.device_bytes)},
            {"predicted_bytes", known(row.predicted_bytes)}}},
          {"devices", row.devices.empty() ? nlohmann::json::array()
                                          : nlohmann::json(row.devices.at(row.refactorization.middle()))}};
}

}  // namespace espalier::bench
