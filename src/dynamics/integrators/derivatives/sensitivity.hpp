/// \file
/// How the motion of a system depends on its parameters: forward sensitivities through the steps of BDF formulas.
#pragma once

#include <array>
#include <deque>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// The system with one parameter below and above its value, p - step and p + step. Both outlive what uses them.
struct ParameterSides {
  double step = 0;
  Equations* below = nullptr;
  Equations* above = nullptr;
};

/// Derivatives of a state by one parameter: dq is a tangent vector, n numbers.
struct Variation {
  std::vector<double> dq, dv, da, dlambda;
};

/// s = d(q, v, a, lambda)/dp satisfies the equations of a step of the BDF formula, linearised at the accepted state:
/// the levels of motion, position, velocity and acceleration, and the two formulas up to what the constraints take
/// (docs/design/dynamics.md). It is found with one factor of K at that state for all parameters, by the passes that
/// Newton's iteration makes, too. What the equations lack at s is a central difference of the equations of two systems,
/// with p - step at q (+) -step s and with p + step at q (+) step s. So nothing is left out that residual() and
/// constraints() know: charts, frames that move with p, friction, forces as functions of reactions.
class ForwardSensitivity {
 public:
  /// @param nominal  equations with a factor of their own, not the integrator's
  /// @param remembers  the system remembers what slipped in a step (friction of contacts). The nominal one knows of
  /// this step already when step() is called, so K is that of the system above the first parameter, which does not
  ForwardSensitivity(Equations& nominal, const std::vector<ParameterSides>& parameters, bool remembers = false);

  /// The beginning, and the states that the systems of each parameter begin with (below, above).
  void start(const State& nominal, const std::vector<std::array<const State*, 2>>& sides);
  /// After an accepted step with a formula of this order.
  void step(const State& now, int order);
  /// At an equilibrium, where only positions and reactions count. @pre no steps are taken
  void statics(const State& now);

  [[nodiscard]] std::size_t parameters() const { return sides_.size(); }
  /// The states to both sides that the present derivative belongs to: 0 below, 1 above.
  [[nodiscard]] const State& side(std::size_t p, int above) const { return sides_[p].state[above]; }
  /// The largest change of a last pass so far, over the largest derivative: how well the linear equations are solved.
  [[nodiscard]] double defect() const;

 private:
  struct Past {
    double t;
    std::vector<double> q, v;
  };
  struct Change {
    double q = 0, v = 0;
  };
  struct Side {
    ParameterSides of;
    Variation s;
    State state[2];
    std::deque<Variation> past;           // newest first, dq and dv
    double size_q = 0, size_v = 0;        // largest so far
    Change left;                          // largest last change so far
    double nothing_q = 0, nothing_v = 0;  // derivatives below them are rounding
  };
  /// What two sides differ by, over 2 step.
  struct Defects {
    std::vector<double> motion, position, velocity, acceleration, chart, rate;
  };
  /// The formula of a step: weights, and past points of one side in the chart around the newest of them.
  struct SidePast {
    std::vector<double> base;
    std::vector<std::vector<double>> theta, v;
  };
  [[nodiscard]] Equations& equations(const Side& side, int above) const {
    return above ? *side.of.above : *side.of.below;
  }
  void place(Side& side, const State& now) const;
  SidePast past_of(const Side& side, int above) const;
  void measure(Side& side, const SidePast past[2], Defects& out);
  void solve(const std::vector<double>& upper, const std::vector<double>& lower, std::vector<double>& x,
             std::vector<double>& multipliers);
  Change pass(Side& side, const SidePast past[2], const State& now);
  [[nodiscard]] static double relative(const Side& side, const Change& change, double rounding);
  void predict(Side& side) const;
  void take_tangent(const State& now);
  void take_tangent_of(const Side& side, int above);
  void settle(Side& side, const State& now, const SidePast past[2]);
  [[nodiscard]] std::vector<double> times_w(const std::vector<double>& x) const;

  Equations& nominal_;
  Equations* usual_;   // whose K is factorized at the nominal state
  Equations* linear_;  // whose K is, at present
  std::vector<Side> sides_;
  std::deque<Past> past_;
  std::vector<double> weights_;  // of the present formula; weights_[0] belongs to the new point
  double hp_ = 0;                // 1 / weights_[0]; 0: statics
};

}  // namespace espalier::dynamics
