#include "dynamics/integrators/integrator.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::dynamics {

void Integrator::integrate(double t_end, const std::function<bool(const StepReport&)>& observe) {
  // The last ulps of the interval are no step of their own.
  const double slack = 4e-16 * std::max(std::abs(t_end), std::abs(state().t));
  while (t_end - state().t > slack) {
    const StepReport report = step(t_end);
    if (observe && !observe(report)) return;
  }
}

void Integrator::count(const StepReport& report) {
  ++counts_.steps;
  counts_.newton_iterations += report.newton_iterations;
  counts_.error_failures += report.error_failures;
  counts_.newton_failures += report.newton_failures;
  counts_.crossings += report.crossings;
  if (report.rounding > 0) ++counts_.rounded;
  counts_.largest_rounding = std::max(counts_.largest_rounding, report.rounding);
  counts_.largest_position = std::max(counts_.largest_position, report.levels.position);
  counts_.largest_velocity = std::max(counts_.largest_velocity, report.levels.velocity);
  counts_.largest_acceleration = std::max(counts_.largest_acceleration, report.levels.acceleration);
}

}  // namespace espalier::dynamics
