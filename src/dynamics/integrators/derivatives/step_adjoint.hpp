/// \file
/// The equations of an accepted BDF step, linearised and transposed: what derivatives need on their way backwards.
#pragma once

#include <span>
#include <vector>

#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/dae/equations.hpp"
#include "dynamics/integrators/derivatives/chart_rates.hpp"
#include "dynamics/integrators/derivatives/level_derivatives.hpp"
#include "espalier/solver.hpp"

namespace espalier::dynamics {

/// What a number, in the end, depends on of one state: n, n, n and m slopes.
struct StateSlopes {
  std::vector<double> q, v, a, lambda;
};

/// Factors of the equations of one step in the derivative of that number.
struct StepMultipliers {
  std::vector<double> position, velocity, acceleration;  ///< of the levels of the constraints, m each
  std::vector<double> motion;                            ///< n
  std::vector<double> formula_q, formula_v;              ///< h' W^T times those of the two formulas, n each
};

/// Changes s = (dq, dv, da, dlambda) of an accepted step satisfy, with h' = 1/w_0 and N = Phi_q^T + F_lambda,
///   h' W (sum_j D_j dq_j - dv) + N mu_1 = 0                  the formula for positions (ChartRates)
///   Phi_q dq                                     = -dPhi/dp
///   h' W (sum_j w_j dv_j - da) + N mu_2 = 0                  the formula for velocities
///   Phi_q dv + (Phi_q v - nu)_q dq               = -d(Phi_q v - nu)/dp
///   F_q dq + F_v dv + F_a da + N dlambda         = -d(F + Phi_q^T lambda)/dp
///   Phi_q da + (..)_q dq + (..)_v dv             = -d(Phi_q a - gamma)/dp
/// where mu is what the constraints take from the formulas (docs/design/dynamics.md): the fixed point of the passes of
/// ForwardSensitivity, to which an object of this class has the transposed matrix. It is solved with by passes, too:
/// the transposed of those of Newton's iteration, with a factor of K^T at the accepted state.
class StepAdjoint {
 public:
  /// @param equations  with constraints to be left out; their factor is not used; outlive the object
  /// @param steps  moves of the n coordinates for differences of the constraints
  StepAdjoint(Equations& equations, const AssembledSystem& system, std::vector<double> steps, int threads);

  /// Takes the step that ended at `now`, with a formula on the past points, newest first.
  /// @throws Error where K is singular
  void take(const State& now, std::span<const State* const> past);
  /// Multipliers of the equations of the step, for slopes by its state. @throws Error where the passes do not converge
  [[nodiscard]] StepMultipliers solve(const StateSlopes& slopes);
  /// Adds what the step makes of changes of the past point j (0: the newest) to the slopes by that one.
  void add_to_past(const StepMultipliers& y, std::size_t j, StateSlopes& slopes) const;

  /// The largest change of a last pass so far, over the largest value.
  [[nodiscard]] double left() const { return left_; }
  /// How far the equations of motion and the levels are from their differences along the answer to random forces:
  /// relatively to these forces, and to the terms of a row. @pre the state is that of the step taken last
  [[nodiscard]] double defect(const State& now);

 private:
  void layout();
  void tangents(const State& now);
  void factorize();
  [[nodiscard]] std::vector<double> solve_transposed(const std::vector<double>& r);
  [[nodiscard]] std::vector<double> times(const std::vector<double>& y) const;
  [[nodiscard]] std::vector<double> pass(const std::vector<double>& r);
  void add_border(ConstSpan u, Span out) const;
  [[nodiscard]] double size_of(const std::vector<double>& y) const;
  [[nodiscard]] bool dropped(Index row) const;
  [[nodiscard]] double difference_of_levels(const State& now, const StateSlopes& along, double step);

  Equations& equations_;
  System& system_;
  ChartRates rates_;
  LevelDerivatives levels_;
  Solver solver_;
  std::size_t n_ = 0, m_ = 0;
  std::uint64_t version_ = 0;
  bool have_layout_ = false, analyzed_ = false;
  SparseMatrix k_;
  std::vector<double> by_a_, by_v_, by_q_, w_, f_lambda_;  // values of F_a, F_v, F_q, W and F_lambda
  std::vector<double> weights_;                            // of the formula
  double hp_ = 0, left_ = 0;
};

}  // namespace espalier::dynamics
