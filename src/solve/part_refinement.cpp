#include "solve/part_refinement.hpp"

#include <algorithm>
#include <vector>

#include "solve/refinement_steps.hpp"

namespace espalier::solve {

void refine_parts(const device::PartSpace& a, const Preconditioner& m, const Systems& systems,
                  const RefinementOptions& options, std::span<RefinementResult> results) {
  const auto [b, x, columns, transpose] = systems;
  const bool steps = options.steps > 0;  // else errors are wanted, not residuals
  const ResidualSpace::Vectors residuals = steps ? a.vectors(0, columns) : ResidualSpace::Vectors{};
  const ResidualSpace::Vectors trials = steps ? a.vectors(1, columns) : ResidualSpace::Vectors{};
  std::vector<BackwardError> errors(results.size());
  std::vector<char> active(results.size()), taken(results.size());
  a.compute_parts({b, x, residuals.data, columns}, errors, transpose);
  for (std::size_t k = 0; k < results.size(); ++k) {
    results[k] = {};
    results[k].error = errors[k];
    active[k] = worth_a_step(errors[k], 0, options) ? 1 : 0;
  }
  while (std::find(active.begin(), active.end(), 1) != active.end()) {
    m(residuals.data, trials.data, columns);
    for (Index c = 0; c < columns; ++c) (void)a.add(x + Offset{c} * a.size(), trials.data + Offset{c} * a.size());
    a.compute_parts({b, trials.data, residuals.data, columns}, errors, transpose);
    for (std::size_t k = 0; k < results.size(); ++k) {
      taken[k] = 0;
      if (active[k] == 0) continue;
      RefinementResult& r = results[k];
      const auto [better, stalled] = judge_step(r.error, errors[k]);
      ++r.steps;
      if (better) r.error = errors[k];
      taken[k] = better ? 1 : 0;
      active[k] = !stalled && worth_a_step(r.error, r.steps, options) ? 1 : 0;
    }
    a.copy_parts(trials.data, x, columns, taken);
  }
}

}  // namespace espalier::solve
