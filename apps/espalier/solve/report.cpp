#include "solve/report.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/output_file.hpp"
#include "command.hpp"
#include "solver/options/option_text.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::cli {

namespace {

using Json = nlohmann::ordered_json;

Json matrix_json(const RunRecord& record) {
  return {{"source", record.input},
          {"rows", record.rows},
          {"nonzeros", record.nonzeros},
          {"symmetric", record.symmetric()},
          {"complex", record.complex},
          {"hermitian", record.hermitian()},
          {"read_seconds", record.read_seconds},
          {"notices", record.notices}};
}

Json analysis_json(const AnalysisResult& analysis) {
  return {{"seconds", analysis.seconds},
          {"matching_seconds", analysis.matching_seconds},
          {"ordering_seconds", analysis.ordering_seconds},
          {"plan_seconds", analysis.plan_seconds},
          {"nonzeros_factor", analysis.nonzeros_factor},
          {"flops", analysis.flops},
          {"fronts", analysis.fronts},
          {"tiers", analysis.tiers},
          {"largest_front", analysis.largest_front},
          {"predicted_seconds", analysis.predicted_seconds}};
}

Json factor_json(const RunRecord& record) {
  const auto refactor = record.best_refactor_seconds();
  return {{"seconds", record.first_factor_seconds},
          {"flops_per_second", record.best_rate()},
          {"refactor_seconds", refactor ? Json(*refactor) : Json(nullptr)},
          {"refactorizations", record.refactor_seconds.size()}};
}

Json solve_json(const RunRecord& record) {
  return {{"seconds", record.solve->seconds},
          {"substitution_seconds", record.solve->solve_seconds},
          {"columns", record.columns},
          {"refinement_steps", record.solve->refinement_steps}};
}

Json devices_json(const std::vector<DeviceReport>& devices) {
  Json list = Json::array();
  for (const DeviceReport& device : devices) {
    list.push_back({{"name", device.name},
                    {"busy_seconds", device.busy_seconds},
                    {"idle_fraction", device.idle_fraction},
                    {"peak_bytes", device.peak_bytes},
                    {"waiting_seconds", device.waiting_seconds},
                    {"stolen_subtrees", device.stolen_subtrees},
                    {"transferred_bytes", device.transferred_bytes},
                    {"streamed_in_bytes", device.streamed_in_bytes},
                    {"streamed_out_bytes", device.streamed_out_bytes},
                    {"disk_written_bytes", device.disk_written_bytes},
                    {"disk_read_bytes", device.disk_read_bytes},
                    {"link_seconds", device.link_seconds},
                    {"predicted_peak_bytes", device.predicted_peak_bytes}});
  }
  return list;
}

/// The parts that need a factorization; null when there was none.
void add_factor_parts(Json& report, const RunRecord& record) {
  const auto& factor = record.factor;
  report["factor"] = factor ? factor_json(record) : Json(nullptr);
  report["solve"] = record.solve ? solve_json(record) : Json(nullptr);
  report["backward_error"] = nullptr;
  if (record.solve) {
    report["backward_error"] = {{"normwise", record.solve->backward_error},
                                {"componentwise", record.solve->componentwise_error}};
  }
  report["rank"] = report["dependent_rows"] = nullptr;
  report["inertia"] = nullptr;
  report["pivots"] = nullptr;
  report["determinant"] = nullptr;
  if (factor) {
    if (factor->rank >= 0) report["rank"] = factor->rank;
    report["dependent_rows"] = factor->dependent_rows;
    report["inertia"] = {
        {"positive", factor->inertia.positive}, {"negative", factor->inertia.negative}, {"zero", factor->inertia.zero}};
    report["pivots"] = {
        {"two_by_two", factor->two_by_two}, {"perturbed", factor->perturbed}, {"delayed", factor->delayed}};
    const std::complex<double> phase = record.determinant_phase;
    report["determinant"] = {{"sign", record.complex ? Json(nullptr) : Json(record.determinant_sign)},
                             {"log", factor->determinant_log}};
    if (record.complex) report["determinant"]["phase"] = nullptr;  // of a real form it is not known
    if (record.complex && !std::isnan(phase.real())) report["determinant"]["phase"] = {phase.real(), phase.imag()};
  }
  report["condition_estimate"] = record.condition_estimate ? Json(*record.condition_estimate) : Json(nullptr);
}

}  // namespace

void RunRecord::note(const FactorResult& result) {
  factor = result;
  determinant_sign = result.determinant_sign;
}
void RunRecord::note(const ComplexFactorResult& result) {
  factor = result;
  determinant_phase = result.determinant_phase;
}

std::optional<double> RunRecord::best_refactor_seconds() const {
  if (refactor_seconds.empty()) return std::nullopt;
  return *std::min_element(refactor_seconds.begin(), refactor_seconds.end());
}

double RunRecord::best_rate() const {
  const double seconds = best_refactor_seconds().value_or(first_factor_seconds);
  return analysis && seconds > 0 ? analysis->flops / seconds : 0;
}

Json to_json(const RunRecord& record) {
  Json report;
  report["espalier"] = solver::version();
  report["status"] = solver::name_of(record.status.code);
  report["message"] = record.status.message;
  report["row"] = record.status.row >= 0 ? Json(record.status.row) : Json(nullptr);
  report["exit_code"] = exit_code(record.status.code);
  report["matrix"] = matrix_json(record);
  report["kind"] = record.analysis ? Json(solver::name_of(record.analysis->kind)) : Json(nullptr);
  report["precision"] = solver::name_of(record.precision);
  report["analysis"] = record.analysis ? analysis_json(*record.analysis) : Json(nullptr);
  add_factor_parts(report, record);
  report["memory"] = {{"predicted_bytes", record.analysis ? Json(record.analysis->predicted_bytes) : Json(nullptr)},
                      {"peak_host_bytes", record.factor ? Json(record.factor->peak_host_bytes) : Json(nullptr)}};
  report["devices"] = record.factor ? devices_json(record.factor->devices) : Json::array();
  return report;
}

Json disk_forecast(const AnalysisResult& a, const base::DiskRates& disk) {
  return {{"bytes", a.predicted_disk_bytes},           {"written_bytes", a.predicted_disk_written_bytes},
          {"read_bytes", a.predicted_disk_read_bytes}, {"way_read_bytes", a.predicted_way_read_bytes},
          {"write_bytes_per_second", disk.write},      {"read_bytes_per_second", disk.read}};
}

Json to_json(const std::vector<Solver::TierRow>& tiers) {
  Json list = Json::array();
  for (const auto& tier : tiers) {
    list.push_back({{"tier", tier.tier},
                    {"fronts", tier.fronts},
                    {"largest_front", tier.largest_front},
                    {"flops", tier.flops},
                    {"factor_entries", tier.factor_entries}});
  }
  return list;
}

std::string to_text(const Json& report) { return report.dump(2, ' ', false, Json::error_handler_t::replace); }

std::optional<Error> write_report(const std::string& path, const nlohmann::ordered_json& report) {
  if (path.empty()) return std::nullopt;
  try {
    base::OutputFile file(path);
    file.write(to_text(report) + "\n");
    file.commit();
  } catch (const Error& error) {
    return error;
  }
  return std::nullopt;
}

}  // namespace espalier::cli
