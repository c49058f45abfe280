#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string>

#include "solver/factor.hpp"

namespace espalier::solver {

namespace {

DeviceReport device_report(device::DeviceWork w, double seconds) {
  const double idle = seconds > 0 ? std::max(0.0, 1 - w.busy_seconds / seconds) : 0;
  return {std::move(w.name),
          w.busy_seconds,
          idle,
          w.peak_bytes,
          w.waiting_seconds,
          w.stolen_subtrees,
          w.streaming.bytes_in,
          w.streaming.bytes_out,
          w.streaming.link_seconds,
          w.streaming.predicted_bytes,
          w.transferred_bytes};
}

std::vector<DeviceReport> device_reports(const Numeric& numeric, const device::FactorOutcome& outcome) {
  std::vector<DeviceReport> reports;
  for (device::DeviceWork& w : numeric.device_work()) reports.push_back(device_report(std::move(w), outcome.seconds));
  if (!reports.empty()) return reports;
  device::DeviceWork one;
  one.name = numeric.device_name();
  one.busy_seconds = outcome.busy_seconds;
  one.waiting_seconds = outcome.waiting_seconds;
  one.peak_bytes = numeric.device_peak_bytes();
  one.streaming = numeric.streaming();
  reports.push_back(device_report(std::move(one), outcome.seconds));
  return reports;
}

std::vector<Index> rows_of(const Analysis& analysis, const std::vector<Index>& positions) {
  std::vector<Index> rows;
  for (const Index p : positions)
    rows.push_back(analysis.system->equations.row_of(analysis.plan.tree.order[static_cast<std::size_t>(p)]));
  std::sort(rows.begin(), rows.end());
  return rows;
}

Status not_positive(Index row) {
  return {StatusCode::not_positive_definite,
          fmt::format("the matrix is not positive definite: the pivot of {} is not positive; use kind ldlt (or auto)",
                      name_rows({row})),
          row};
}

Status singular(const std::vector<Index>& rows, Index n) {
  return {StatusCode::singular,
          fmt::format("the matrix is numerically singular: {} of {} pivots vanish, at {}; remove or fix dependent rows",
                      rows.size(), n, name_rows(rows)),
          rows.front()};
}

}  // namespace

FactorResult report_factor(const Analysis& analysis, const Numeric& numeric, const device::FactorOutcome& outcome,
                           const Options& options, Offset held_bytes) {
  FactorResult r;
  const Index n = analysis.n();
  r.two_by_two = outcome.two_by_two;
  r.perturbed = static_cast<Index>(outcome.replaced.size());
  r.delayed = analysis.moved_pivots;
  r.peak_host_bytes = held_bytes;
  r.device = analysis.result.device;
  r.devices = device_reports(numeric, outcome);
  if (outcome.not_positive >= 0) {
    r.status = not_positive(rows_of(analysis, {outcome.not_positive}).front());
    return r;
  }
  const Equations& e = analysis.system->equations;
  r.determinant_sign = outcome.determinant_sign * e.transform_sign;
  r.determinant_log = outcome.determinant_log - e.transform_log;
  if (analysis.kind() == Kind::llt) r.inertia = {n - r.perturbed, 0, r.perturbed};
  if (analysis.kind() == Kind::ldlt) r.inertia = {n - outcome.negative - r.perturbed, outcome.negative, r.perturbed};
  if (r.perturbed > 0 && options.perturbation <= 0) {
    r.determinant_sign = 0;
    r.determinant_log = -std::numeric_limits<double>::infinity();
    r.status = singular(rows_of(analysis, outcome.replaced), n);
  }
  return r;
}

}  // namespace espalier::solver
