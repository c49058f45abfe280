#include "solver/c_results.hpp"

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

espalier_factor_info to_c(const FactorResult& r) {
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
  info.determinant_sign = r.determinant_sign;
  info.determinant_log = r.determinant_log;
  info.peak_host_bytes = r.peak_host_bytes;
  return info;
}

NullSpace null_space_of(FactorResult r, bool transposed) {
  const bool symmetric = r.left_null_vectors.empty();
  if (transposed && !symmetric) return {std::move(r.dependent_columns), std::move(r.left_null_vectors)};
  return {std::move(r.dependent_rows), std::move(r.null_vectors)};
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
