/// \file
/// What all time integrators have in common.
#pragma once

#include <functional>
#include <memory>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// One accepted step, for the log line and for statistics.
struct StepReport {
  long index = 0;             ///< number of the step, from 1
  double t = 0;               ///< time at its end
  double h = 0;               ///< its length
  int order = 0;              ///< order of the formula
  int newton_iterations = 0;  ///< of the successful attempt
  int factorizations = 0;     ///< all attempts together
  int error_failures = 0;     ///< attempts rejected by the error test
  int newton_failures = 0;    ///< attempts in which Newton did not converge
  int crossings = 0;  ///< 1 if the step needed the iteration for places (next to a singular position of the mechanism)
  double residual = 0;     ///< largest residual of the equations of motion at the last evaluation
  double error = 0;        ///< local error estimate in units of the tolerance (accepted below 1); 0 when not tested
  double newton_rate = 0;  ///< convergence rate of the last iteration, 0 when there was only one
  /// Where rounding ended Newton's iteration: its last change of accelerations and multipliers, in units of the largest
  /// of them (scaled by masses). 0: it reached the accuracy asked for.
  double rounding = 0;
  Levels levels;  ///< constraint violations at the end of the step (motion = residual)
};

/// Sums over all steps.
struct IntegratorCounts {
  long steps = 0;
  long newton_iterations = 0;
  long error_failures = 0;
  long newton_failures = 0;
  long crossings = 0;           ///< steps over singular positions
  long refactor_first = 0;      ///< factorizations because there was none yet
  long refactor_step = 0;       ///< ... because the step size left the band of the factor
  long refactor_rate = 0;       ///< ... because Newton slowed down
  long refactor_failed = 0;     ///< ... because Newton failed with an old factor
  long divisions = 0;           ///< halvings of a constant step in which Newton failed with a new factor
  long rounded = 0;             ///< steps in which rounding ended Newton's iteration
  double largest_rounding = 0;  ///< StepReport::rounding of them
  double first_division = 0, shortest_step = 0;  ///< time of the first of them; the shortest step that came of them
  double largest_position = 0, largest_velocity = 0, largest_acceleration = 0;  ///< constraint violations
};

/// Advances a state in time. Not safe for concurrent calls.
class Integrator {
 public:
  virtual ~Integrator() = default;
  /// Takes a consistent state (see make_consistent) as the beginning.
  virtual void start(const State& state) = 0;
  /// Takes one step, not beyond t_limit.
  /// @throws espalier::Error with time and cause if no step succeeds
  virtual StepReport step(double t_limit) = 0;
  [[nodiscard]] virtual const State& state() const = 0;
  [[nodiscard]] const IntegratorCounts& counts() const { return counts_; }

  /// A copy of its memory without the factor, from which the coming steps can be taken anew.
  [[nodiscard]] virtual std::unique_ptr<Integrator> clone() const = 0;
  /// Appends all numbers that the coming steps depend on to `out` and drops factor and analysis, so that the run that
  /// goes on and one that restores these numbers take the same steps (implementations: integrators/checkpoint.cpp).
  virtual void save(std::vector<double>& out) = 0;
  /// Takes up what save() wrote and removes it from the front of `in`. @pre start() was called for the same system
  /// @throws Error(invalid_input) if the numbers do not fit
  virtual void restore(ConstSpan& in) = 0;

  /// Steps until t_end; `observe`, if given, is called after every step and stops the run by returning false.
  void integrate(double t_end, const std::function<bool(const StepReport&)>& observe = {});

 protected:
  void count(const StepReport& report);
  void save_counts(std::vector<double>& out) const;
  void restore_counts(ConstSpan& in);
  IntegratorCounts counts_;
};

}  // namespace espalier::dynamics
