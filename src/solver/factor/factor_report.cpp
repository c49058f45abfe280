#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string>

#include "solver/factor/factor.hpp"

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
          w.out_of_core.bytes_in,
          w.out_of_core.bytes_out,
          w.out_of_core.link_seconds,
          w.out_of_core.predicted_bytes,
          w.transferred_bytes,
          w.out_of_core.disk_written_bytes,
          w.out_of_core.disk_read_bytes};
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
  one.out_of_core = numeric.out_of_core();
  reports.push_back(device_report(std::move(one), outcome.seconds));
  return reports;
}

Status not_positive(Index row) {
  return {StatusCode::not_positive_definite,
          fmt::format("the matrix is not positive definite: the pivot of {} is not positive; use kind ldlt (or auto)",
                      name_rows({row})),
          row};
}

// Pivots count by their signs (Sylvester), those that stand for a zero do not. Where these are not known one by one,
// what is left of the matrix for all small ones has the inertia of B on the directions of its smallest eigenvalues
// (Haynsworth 1968). In a real form all of them stand twice. Of an odd number of pivots that vanish there, the
// direction that is counted beside them may be negative: what is odd is one too many.
Index negative_eigenvalues(const System& system, const device::FactorOutcome& outcome, const Deficiency& deficiency) {
  const Index twice = system.real_form ? 2 : 1;
  if (deficiency.reduced) return deficiency.negative;
  if (deficiency.zeros == system.unknowns(outcome.replaced.size())) return outcome.negative / twice;
  const Index others = outcome.negative - outcome.small_negative;
  const Index suspects = system.unknowns(outcome.replaced.size() + outcome.small.size());
  return (deficiency.zeros >= suspects ? others : others + twice * deficiency.negative) / twice;
}

// @param code  singular where that is sure
Status unknown_rank(StatusCode code, Index replaced) {
  return {code,
          fmt::format("the matrix is singular or nearly so, and its rank is not known: {} pivots vanish, which do not "
                      "tell how many of its singular values are zero; scale the matrix, or use another kind",
                      replaced),
          -1};
}

std::vector<Index> vanishing(const device::FactorOutcome& outcome, bool with_small) {
  std::vector<Index> positions(outcome.replaced);
  if (!with_small) return positions;
  positions.insert(positions.end(), outcome.small.begin(), outcome.small.end());
  return positions;
}

}  // namespace

void forget_rank(FactorResult& r) {
  r.rank = -1;
  r.inertia = {};
  r.determinant_sign = 0;
  r.determinant_log = std::numeric_limits<double>::quiet_NaN();
}

std::vector<Index> columns_of(const Analysis& analysis, const std::vector<Index>& positions) {
  std::vector<Index> columns;
  for (const Index p : positions) columns.push_back(analysis.system->unknown_of(analysis.plan.tree.order[at(p)]));
  std::sort(columns.begin(), columns.end());
  columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
  return columns;
}

std::vector<Index> rows_of(const Analysis& analysis, const std::vector<Index>& positions) {
  std::vector<Index> rows = columns_of(analysis, positions);
  for (Index& row : rows) row = analysis.system->prepared.row_of(row);
  std::sort(rows.begin(), rows.end());
  return rows;
}

Status singular(const std::vector<Index>& rows, Index zeros, Index n) {
  return {StatusCode::singular,
          fmt::format(
              "the matrix is numerically singular: its rank is {} of {}; {} {} on the other rows: remove or fix "
              "{}, or ask for a report (singular=report)",
              n - zeros, n, name_rows(rows), rows.size() == 1 ? "depends" : "depend", rows.size() == 1 ? "it" : "them"),
          rows.empty() ? -1 : rows.front()};
}

std::complex<double> phase_of_real_form(const Analysis& analysis, const FactorResult& result) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  if (analysis.system->numbers() != base::Numbers::hermitian || analysis.kind() == Kind::lu)
    return {kUnknown, kUnknown};
  return result.inertia.negative % 2 == 0 ? 1 : -1;
}

std::string whole_reason(const Analysis& analysis, const Numeric& numeric) {
  if (numeric.keeps_fronts()) return {};
  if (analysis.device.devices() > 1) return "several GPUs exchange what fronts leave for their parents in each run";
  return "the device keeps no fronts, or has no memory for what they leave for their parents";
}

FactorResult report_factor(const Analysis& analysis, const Numeric& numeric, const device::FactorOutcome& outcome,
                           Deficiency deficiency, const Options& options, Offset held_bytes) {
  FactorResult r;
  const Index n = analysis.n();
  r.two_by_two = outcome.two_by_two;
  const System& system = *analysis.system;
  const Index replaced = system.unknowns(outcome.replaced.size());
  r.perturbed = std::max(replaced, deficiency.zeros);
  r.delayed = analysis.moved_pivots;
  r.peak_host_bytes = held_bytes;
  r.device = analysis.result.device;
  r.devices = device_reports(numeric, outcome);
  if (outcome.not_positive >= 0) {
    r.status = not_positive(rows_of(analysis, {outcome.not_positive}).front());
    return r;
  }
  const PreparedMatrix& p = system.prepared;
  r.determinant_sign = outcome.determinant_sign * p.transform_sign;
  r.determinant_log = outcome.determinant_log / (system.real_form ? 2 : 1) - numeric.scales().log;
  const bool bounded = options.perturbation > 0;  // the caller's bound says which pivots count as zero
  const bool given = bounded || (options.zero_pivot > 0 && !p.unmatched);
  const Index zeros = given ? replaced : deficiency.zeros;
  r.rank = n - zeros;
  if (analysis.kind() == Kind::llt) r.inertia = {n - zeros, 0, zeros};
  if (analysis.kind() == Kind::ldlt && system.numbers() != base::Numbers::complex) {
    const Index negative =
        given ? outcome.negative / (system.real_form ? 2 : 1) : negative_eigenvalues(system, outcome, deficiency);
    r.inertia = {n - negative - zeros, negative, zeros};
  }
  if (!given && r.perturbed > zeros) {  // the factor is that of another matrix
    r.determinant_sign = 0;
    r.determinant_log = std::numeric_limits<double>::quiet_NaN();
  }
  if (!given && replaced > 0 && deficiency.doubtful) {
    forget_rank(r);
    const bool surely_singular = zeros > 0 && options.singular == SingularMatrix::error;
    r.status = unknown_rank(surely_singular ? StatusCode::singular : StatusCode::accuracy_not_reached, replaced);
    return r;
  }
  if (zeros == 0 || bounded) return r;
  r.determinant_sign = 0;
  r.determinant_log = -std::numeric_limits<double>::infinity();
  if (deficiency.by_pivots) {
    deficiency.rows = rows_of(analysis, analysis.kind() == Kind::lu ? outcome.replaced_rows : outcome.replaced);
    if (analysis.kind() == Kind::lu) deficiency.columns = columns_of(analysis, outcome.replaced);
  }
  r.dependent_rows =
      deficiency.complete && !given ? std::move(deficiency.rows) : rows_of(analysis, vanishing(outcome, !given));
  r.null_vectors = std::move(deficiency.null_vectors);
  r.dependent_columns = std::move(deficiency.columns);
  r.left_null_vectors = std::move(deficiency.left_vectors);
  if (options.singular == SingularMatrix::error) r.status = singular(r.dependent_rows, zeros, n);
  return r;
}

}  // namespace espalier::solver
