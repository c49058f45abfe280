/// \file
/// The generalized-alpha method on a Lie group, index 3.
#pragma once

#include <initializer_list>
#include <optional>

#include "dynamics/dae/vectors.hpp"
#include "dynamics/integrators/factor_renewal.hpp"
#include "dynamics/integrators/integrator.hpp"
#include "dynamics/integrators/shared_vectors.hpp"

namespace espalier::dynamics {

struct AlphaOptions {
  double step = 1e-3;            ///< constant step size, divided where Newton fails
  double spectral_radius = 0.8;  ///< at infinite frequency (rho): 1 no damping, 0 annihilation; order 2 for any
  double hht_alpha = 1;          ///< in [-1/3, 0]: the HHT method with this alpha instead (1: not used)
  /// Error that the end of Newton's iteration may leave in accelerations and multipliers, in units of the error that
  /// the method itself makes in a step; less where spectral_radius is above 0.9.
  double newton_tolerance = 0.01;
  double tolerance = 1e-8;  ///< and at most so much of q and h v, relative to (relative |q| + absolute)
  double relative = 1.0;    ///< weights of that: tolerance * (relative * |q_i| + absolute)
  double absolute = 1.0;
  double constraint_tolerance = 1e-10;  ///< of Phi
  int max_newton = 15;
  /// A slower convergence rate asks for a new factor at the next step; none: that is done where the passes which a new
  /// one saves cost more than it (factor_renewal.hpp).
  std::optional<double> refactor_rate;
  /// Where Newton has failed, its changes are halved as long as forces grow: for contact and friction, whose laws have
  /// corners. Without corners a step in which Newton fails is too long as a rule, and shorter ones are more exact.
  bool search = false;
  bool operator==(const AlphaOptions&) const = default;
};

/// Chung and Hulbert 1993, on Lie groups and for constraints as Arnold and Bruels 2007, Bruels, Cardona, Arnold 2012:
///   q_(n+1) = q_n (+) (h v_n + h^2 (1/2 - beta) a_n + h^2 beta a_(n+1))
///   v_(n+1) = v_n + h (1 - gamma) a_n + h gamma a_(n+1)
///   (1 - alpha_m) a_(n+1) + alpha_m a_n = (1 - alpha_f) v'_(n+1) + alpha_f v'_n
/// with F and Phi = 0 at t_(n+1); v' and lambda are the accelerations and multipliers of the state. Velocities and
/// accelerations are meant in axes that do not turn, those of q_n: angular ones of rigid bodies, which the state has in
/// body axes, are turned by exp(-delta) at the end of the step (carry()). In body axes whatever a body that spins sees
/// from outside oscillates with its speed, and the error grows with it (heavy top: five times). The velocity and
/// acceleration levels of the constraints are not enforced (index 3): their violations are reported, of order h^2.
///
/// Non-holonomic constraints hold at t_(n+1) for the velocities (index 2): (Phi_q v - nu) c_q / c_v stands in the place
/// of their Phi.
///
/// Newton's unknowns are v' and lambda, q moves by c_q = h^2 beta (1 - alpha_f) / (1 - alpha_m) times the change of v',
/// and the constraints are divided by c_q: in these variables K does not depend on h (Bottasso, Dopico, Trainelli,
/// Multibody Syst. Dyn. 19, 2008). Changes are measured as KktSolver scales them, |W_ii|^1/2 |dv'_i| and the like for
/// lambda, so that masses, lengths and angles count alike. What counts is v': a change of q of 1e-8 that is left over
/// means 1e-8 / c_q in v' and lambda, and a step ten times as small makes a hundred times as much of it. The method's
/// own error in v' is of the size of h^2 |v'''| / 12 and more (that of the trapezoidal rule, the least of all A-stable
/// methods of order 2: Dahlquist 1963); the iteration ends when it has newton_tolerance times that left
/// (alpha_newton.cpp). Where the rounding of q, |q| eps / c_q in v', does not allow it, the iteration ends when it
/// falls no more, and StepReport::rounding says at which level.
///
/// Where the factor and flexible bodies lie on a GPU, the vectors of Newton's iteration follow them (alpha_device.cpp).
/// The host then sees what its joints and forces look at, and gets the whole state once a step.
class GeneralizedAlpha final : public Integrator {
 public:
  GeneralizedAlpha(Equations& equations, const AlphaOptions& options);

  void start(const State& state) override;
  /// A step in which Newton fails with a new factor (and the search of the options, if chosen) is halved, again and
  /// again if need be; after some short steps the double length is tried. IntegratorCounts::divisions counts it.
  StepReport step(double t_limit) override;
  [[nodiscard]] const State& state() const override { return state_; }
  [[nodiscard]] std::unique_ptr<Integrator> clone() const override;
  void save(std::vector<double>& out) override;
  void restore(ConstSpan& in) override;
  /// Whether the vectors lie on a GPU.
  [[nodiscard]] bool on_device() const { return vectors_.on_device(); }

 private:
  enum class Outcome { converged, slow, diverged };
  // One pass of Newton.
  struct Change {
    double force = 0;     // largest residual of the equations of motion before it, in the same scale
    double scaled = 0;    // largest change of v' and lambda, as KktSolver scales them
    double weighted = 0;  // of q and h v, in units of the tolerance
    double q = 0;         // largest of q
    double second = 0;    // after it, on a GPU: largest second difference of v', in that scale
  };
  /// body(i) for each velocity coordinate, on all threads.
  template <class Body>
  void for_coordinates(const Body& body) const {
    for_each_entry(equations_.pool(), delta_.size(), body);
  }
  void coefficients(double h);
  void predict();
  void reach();
  void carry(std::initializer_list<Span> vectors) const;
  void constraints_of_trial();
  void weigh();
  [[nodiscard]] double weight_of(double size) const;
  void learn_trend();
  void set_trend(double along, double square);
  void factorize(long& reason);
  [[nodiscard]] bool wants_new_factor();
  [[nodiscard]] double next_length(double t_limit) const;
  bool attempt(double h, bool renew, StepReport& report);
  bool attempt_here(double h, bool renew, StepReport& report);
  void begin_factor(bool renew);
  void give_way();
  void accept();
  /// Whether the time up to t_limit is too short for a step of the method.
  [[nodiscard]] bool sliver(double t_limit) const;
  void drift(double t);  ///< to there, with the acceleration that is known
  // Newton's iteration (alpha_newton.cpp)
  Outcome solve(StepReport& report);
  Change iterate(StepReport& report, double before);
  void find_forces(Change& change, StepReport& report, double before);
  void take_change(Change& change, StepReport& report);
  double search_back(double before);
  [[nodiscard]] double scaled_norm(ConstSpan a, ConstSpan lambda) const;
  [[nodiscard]] double scaled_multipliers(ConstSpan lambda, double largest) const;
  [[nodiscard]] double scaled_force(ConstSpan f) const;
  [[nodiscard]] double local_error(const Change& change) const;
  [[nodiscard]] bool rounding_ends(const Change& change, double rate);
  Outcome end_at_rounding(const Change& change, StepReport& report);
  // Vectors on a GPU (alpha_device.cpp); without it the same calls serve the host.
  [[nodiscard]] MotionArrays arrays();
  /// loop(arrays, i) for each velocity coordinate, where it lies.
  template <class Loop>
  void run(const Loop& loop) {
    vectors_.run(arrays(), loop);
  }
  [[nodiscard]] MotionRecord measure(const MotionMeasure& what) { return vectors_.measure(arrays(), what); }
  void choose_place(double h);
  void enter_device();
  void reach_there();
  void weigh_there();
  void find_forces_there();
  void solve_there();
  [[nodiscard]] double take_change_there(Change& change, StepReport& report);
  void end_step_there();
  // Lengths of steps that change (alpha_length.cpp)
  [[nodiscard]] bool changes_length(double h) const;
  void fit(double h);
  void learn_jerk();
  void add_offset(double h, double sign, Span out) const;
  [[nodiscard]] bool settle(StepReport& report);

  Equations& equations_;
  AlphaOptions options_;
  SharedVectors vectors_;
  State state_, trial_;
  double alpha_m_ = 0, alpha_f_ = 0, beta_ = 0, gamma_ = 0;
  double newton_share_ = 0;  // of the method's error in a step, what Newton's iteration may leave
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
  bool search_ = false;       // Newton failed lately: changes are searched along
  double rate_ = 0.5;
  bool rate_measured_ = false;  // in this step or in the one before
  double factor_cost_ = 0;      // in passes
  FactorLife factor_life_;
  int passes_of_factor_ = 0;  // in this step, with the present factor
  double local_error_ = 0;    // of the step before, scaled
  double floor_ = 0;          // c_q times the change at which Newton stood still with a new factor; 0: not met
  double force_floor_ = 0;    // residual of the equations of motion there, scaled
  double size_q_ = 0;         // largest coordinate
  double size_q_there_ = 0;   // of those on a GPU
  double drifted_ = 0;        // time since the last step of the method
  double fitted_ = 0;         // the length of steps that v and a_old_ belong to; 0: to none yet
  bool jerk_known_ = false;
  bool plain_start_ = false;  // the start is not fitted: no v'' was found
  std::vector<double> jerk_;  // dv'/dt at the beginning of the step
  std::vector<double> a_old_, a_base_, v_base_,
      delta_base_;                                // algorithmic acceleration; constant parts of the formulas
  std::vector<double> a_from_, v_from_;           // a_old_ and v, fitted to the length of the step
  std::vector<double> a_step_;                    // v' of the trial state, in the axes of q_n as all but the state is
  std::vector<double> a_before_, lambda_before_;  // at the beginning of the step before
  std::vector<double> delta_, weight_, f_, rhs_, work_;
  std::vector<double> force_;           // F, scaled, of the host's coordinates beside a GPU
  std::vector<double> change_;          // the last one of a and lambda, n + m, for a search
  mutable std::vector<double> second_;  // second differences, n + m
};

}  // namespace espalier::dynamics
