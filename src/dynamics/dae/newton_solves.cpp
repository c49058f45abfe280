#include "dynamics/dae/newton_solves.hpp"

#include <cmath>
#include <limits>

namespace espalier::dynamics {

namespace {

bool unrefined(const Options& o) { return o.refinement_steps == 0 && std::isinf(o.required_backward_error); }

// Refinement as it was, whatever ends the solve.
class OneStep {
 public:
  explicit OneStep(Solver& solver) : solver_(solver) { solver.set_refinement(1, NewtonSolves::kMostError); }
  OneStep(const OneStep&) = delete;
  OneStep& operator=(const OneStep&) = delete;
  ~OneStep() { solver_.set_refinement(0, std::numeric_limits<double>::infinity()); }

 private:
  Solver& solver_;
};

}  // namespace

void NewtonSolves::take(const Solver& solver, const FactorResult& factor) {
  const Options& o = solver.options();
  to_check_ = o.precision == Precision::automatic && factor.precision == Precision::mixed && unrefined(o);
}

Status NewtonSolves::solve(Solver& solver, std::span<const double> b, std::span<double> x, Index columns) {
  if (!to_check_) return solver.solve(b, x, columns).status;
  to_check_ = false;
  const OneStep now(solver);
  return solver.solve(b, x, columns).status;
}

}  // namespace espalier::dynamics
