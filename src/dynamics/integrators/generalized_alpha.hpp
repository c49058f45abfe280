/// \file
/// The generalized-alpha method on a Lie group, index 3.
#pragma once

#include "dynamics/integrators/integrator.hpp"

namespace espalier::dynamics {

struct AlphaOptions {
  double step = 1e-3;            ///< constant step size, divided where Newton fails
  double spectral_radius = 0.8;  ///< at infinite frequency (rho): 1 no damping, 0 annihilation; order 2 for any
  double hht_alpha = 1;          ///< in [-1/3, 0]: the HHT method with this alpha instead (1: not used)
  double tolerance = 1e-8;  ///< Newton: weighted change of q and h v relative to (relative |q| + absolute), see below
  double relative = 1.0;    ///< weights of the Newton test: tolerance * (relative * |q_i| + absolute)
  double absolute = 1.0;
  double constraint_tolerance = 1e-10;  ///< of Phi
  int max_newton = 15;
  double refactor_rate = 0.25;  ///< a slower convergence rate asks for a new factor at the next step
};

/// Chung and Hulbert 1993, on Lie groups and for constraints as Arnold and Bruels 2007, Bruels, Cardona, Arnold 2012:
///   q_(n+1) = q_n (+) (h v_n + h^2 (1/2 - beta) a_n + h^2 beta a_(n+1))
///   v_(n+1) = v_n + h (1 - gamma) a_n + h gamma a_(n+1)
///   (1 - alpha_m) a_(n+1) + alpha_m a_n = (1 - alpha_f) v'_(n+1) + alpha_f v'_n
/// with F and Phi = 0 at t_(n+1); v' and lambda are the accelerations and multipliers of the state. The velocity and
/// acceleration levels of the constraints are not enforced (index 3): their violations are reported, of order h^2.
class GeneralizedAlpha final : public Integrator {
 public:
  GeneralizedAlpha(Equations& equations, const AlphaOptions& options);

  void start(const State& state) override;
  /// A step in which Newton fails with a new factor is halved, again and again if need be; after some short steps the
  /// double length is tried. IntegratorCounts::divisions counts it.
  StepReport step(double t_limit) override;
  [[nodiscard]] const State& state() const override { return state_; }
  void save(std::vector<double>& out) override;
  void restore(ConstSpan& in) override;

 private:
  enum class Outcome { converged, slow, diverged };
  void coefficients(double h);
  void predict();
  void learn_trend();
  void factorize(long& reason);
  bool attempt(double t_limit, bool renew, StepReport& report);
  void begin_factor(bool renew);
  void give_way();
  void accept();
  Outcome solve(StepReport& report);
  double iterate(StepReport& report);

  Equations& equations_;
  AlphaOptions options_;
  State state_, trial_;
  double alpha_m_ = 0, alpha_f_ = 0, beta_ = 0, gamma_ = 0;
  double h_ = 0;
  double h_before_ = 0;       // of the step before; 0: none
  double trend_ = 1;          // of the last change of a and lambda, how much the predictor takes once more
  double c_v_ = 0, c_q_ = 0;  // dv/da', dq/da' of the trial state (a': true acceleration)
  double factor_c_q_ = 0;     // of the factor; 0: none
  bool rate_poor_ = false, fresh_ = false;
  bool began_fresh_ = false;  // the attempt began with a new factor
  Status failure_;            // what ended the last attempt, if it was not Newton itself
  int halvings_ = 0;          // of the step size, at present
  int steps_at_length_ = 0;   // accepted since the last change of halvings_
  int fresh_left_ = 0;        // steps that renew the factor, see kFreshSteps
  double rate_ = 0.5;
  std::vector<double> a_old_, a_base_, v_base_,
      delta_base_;                                // algorithmic acceleration; constant parts of the formulas
  std::vector<double> a_before_, lambda_before_;  // at the beginning of the step before
  std::vector<double> delta_, weight_, f_, rhs_, change_;
};

}  // namespace espalier::dynamics
