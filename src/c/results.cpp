#include "c/results.hpp"

#include <complex>
#include <utility>

namespace espalier::solver {

espalier_analysis_info to_c(const AnalysisResult& r) {
  espalier_analysis_info info{};
  info.seconds = r.seconds;
  info.ordering_seconds = r.ordering_seconds;
  info.flops = r.flops;
  info.predicted_seconds = r.predicted_seconds;
  info.predicted_bytes = r.predicted_bytes;
  info.nonzeros_factor = r.nonzeros_factor;
  info.fronts = r.fronts;
  info.tiers = r.tiers;
  info.largest_front = r.largest_front;
  return info;
}

namespace {

espalier_factor_info report_to_c(const FactorReport& r) {
  espalier_factor_info info{};
  info.seconds = r.seconds;
  info.flops_per_second = r.flops_per_second;
  info.positive = r.inertia.positive;
  info.negative = r.inertia.negative;
  info.zero = r.inertia.zero;
  info.two_by_two = r.two_by_two;
  info.perturbed = r.perturbed;
  info.rank = r.rank;
  info.delayed = r.delayed;
  info.determinant_log = r.determinant_log;
  info.peak_host_bytes = r.peak_host_bytes;
  info.work_share = r.work_share;
  return info;
}

std::vector<double> parts_of(const std::vector<std::complex<double>>& v) {
  const double* first = reinterpret_cast<const double*>(v.data());
  return {first, first + 2 * v.size()};
}

}  // namespace

espalier_factor_info to_c(const FactorResult& r) {
  espalier_factor_info info = report_to_c(r);
  info.determinant_sign = info.determinant_phase[0] = r.determinant_sign;
  return info;
}

espalier_factor_info to_c(const ComplexFactorResult& r) {
  espalier_factor_info info = report_to_c(r);
  info.determinant_phase[0] = r.determinant_phase.real();
  info.determinant_phase[1] = r.determinant_phase.imag();
  info.determinant_sign = r.determinant_phase == 0.0 ? 0 : 1;
  return info;
}

NullSpace null_space_of(FactorResult r, bool by_rows) {
  const bool columns = by_rows && !r.dependent_columns.empty();
  const bool left = by_rows && !r.left_null_vectors.empty();
  return {std::move(columns ? r.dependent_columns : r.dependent_rows),
          std::move(left ? r.left_null_vectors : r.null_vectors)};
}

NullSpace null_space_of(ComplexFactorResult r, bool by_rows) {
  const bool columns = by_rows && !r.dependent_columns.empty();
  const bool left = by_rows && !r.left_null_vectors.empty();
  return {std::move(columns ? r.dependent_columns : r.dependent_rows),
          parts_of(left ? r.left_null_vectors : r.null_vectors)};
}

espalier_solve_info to_c(const SolveResult& r) {
  espalier_solve_info info{};
  info.seconds = r.seconds;
  info.refinement_steps = r.refinement_steps;
  info.backward_error = r.backward_error;
  info.componentwise_error = r.componentwise_error;
  return info;
}

}  // namespace espalier::solver
