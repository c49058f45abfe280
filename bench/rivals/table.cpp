#include "rivals/table.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "measure/format.hpp"
#include "measure/table.hpp"

namespace espalier::bench {
namespace {

/// Least median refactorization of all rows that are ok.
double best_of(const std::vector<Row>& rows) {
  double best = std::numeric_limits<double>::infinity();
  for (const Row& row : rows)
    if (row.verdict.ok() && !row.refactorization.empty()) best = std::min(best, row.refactorization.median());
  return best;
}

double known_or_none(double value) { return value < 0 ? std::numeric_limits<double>::quiet_NaN() : value; }

measure::Line line_of(const Row& row, double best, bool many) {
  const double seconds = row.refactorization.median();
  std::vector<std::string> texts = {row.spec,
                                    measure::seconds_text(row.analysis.median()),
                                    measure::seconds_text(row.first_factorization.median()),
                                    measure::seconds_text(seconds),
                                    measure::factor_text(row.verdict.ok() ? seconds / best : std::nan("")),
                                    measure::rate_text(known_or_none(row.flops) / seconds),
                                    measure::seconds_text(row.solve_one.median())};
  if (many) texts.push_back(measure::seconds_text(row.solve_many.median()));
  for (const std::string& text : {measure::count_text(known_or_none(static_cast<double>(row.nonzeros_factor))),
                                  measure::bytes_text(known_or_none(static_cast<double>(row.peak_bytes))),
                                  measure::bytes_text(known_or_none(static_cast<double>(row.device_bytes))),
                                  measure::error_text(row.solve_one.empty() ? std::nan("") : row.error.normwise)})
    texts.push_back(text);
  measure::Line line;
  for (std::string& text : texts) line.cells.push_back({std::move(text)});
  return line;
}

/// Null for what is not known, so that nobody takes -1 for a figure.
template <typename T>
nlohmann::json known(T value) {
  return value < 0 ? nlohmann::json(nullptr) : nlohmann::json(value);
}

}  // namespace

std::string text_table(const std::vector<Row>& rows, Index columns) {
  const bool many = columns > 1;
  measure::DataTable table{"",
                           {{"rival", true}, {"analysis"}, {"first"}, {"refactor"}, {"x best"}, {"rate"}, {"solve 1"}}};
  if (many) table.columns.push_back({fmt::format("solve {}", columns)});
  for (const char* name : {"entries of L", "memory", "on GPU", "backward"}) table.columns.push_back({name});
  const double best = best_of(rows);
  for (const Row& row : rows) {
    table.lines.push_back(line_of(row, best, many));
    if (!row.verdict.ok())
      table.notes.push_back(fmt::format("{}: {}: {}", row.spec, nlohmann::json(row.verdict.outcome).get<std::string>(),
                                        row.verdict.message));
  }
  return measure::plain_text(table);
}

nlohmann::json row_record(const Row& row) {
  return {{"rival", row.spec},
          {"version", row.version},
          {"outcome", row.verdict.outcome},
          {"message", row.verdict.message},
          {"analysis", measure::samples_record(row.analysis)},
          {"first_factorization", measure::samples_record(row.first_factorization)},
          {"refactorization", measure::samples_record(row.refactorization)},
          {"solve_one", measure::samples_record(row.solve_one)},
          {"solve_many", measure::samples_record(row.solve_many)},
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
