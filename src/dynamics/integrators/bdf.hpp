/// \file
/// BDF on the over-determined DAE: all three levels of the constraints hold at every step, and the BDF equations hold
/// in the parameter space of the constraint manifold (Yen, Haug, Tak 1991; Fuehrer, Leimkuhler 1991; Hairer, Wanner II,
/// VII.2).
#pragma once

#include <limits>
#include <memory>
#include <optional>

#include "base/named.hpp"
#include "dynamics/dae/switching.hpp"
#include "dynamics/dae/vectors.hpp"
#include "dynamics/integrators/history.hpp"
#include "dynamics/integrators/integrator.hpp"
#include "dynamics/integrators/shared_vectors.hpp"
#include "espalier/dae.hpp"

namespace espalier::dynamics {

inline constexpr base::Named<DaeIteration> kBdfIterations[] = {{"reduced", DaeIteration::reduced},
                                                               {"full-matched", DaeIteration::full_matched},
                                                               {"full-tangent", DaeIteration::full_tangent},
                                                               {"full-boolean", DaeIteration::full_boolean}};

/// Tolerances that follow from the model: the errors of all steps together stay at a part of its extent. A step of
/// length h may have the share h / duration of that (errors per unit of time), so that long runs take no more of it.
struct ErrorBudget {
  double accuracy = 0;  ///< of places, over the extent of the model; 0: the tolerances of the options hold
  double extent = 0;    ///< of the model
  double duration = 0;  ///< of the run
  /// The speed of stiff systems, whose vibrations are not to be followed: velocities are tested at a part of this speed
  /// of the motion. 0: not stiff, velocities are tested as their errors add up to errors of places.
  double speed = 0;
  std::vector<char> lengths = {};  ///< velocity coordinates that are lengths; others are angles and slopes
  [[nodiscard]] bool given() const { return accuracy > 0; }
  [[nodiscard]] bool stiff() const { return speed > 0; }
  /// The size of a coordinate: what a change by it means to the model.
  [[nodiscard]] double size(std::size_t i) const { return lengths[i] != 0 ? extent : 1; }
  bool operator==(const ErrorBudget&) const = default;
};

struct BdfOptions {
  int max_order = 5;             ///< 1 to 5; 2 is wise for lightly damped flexible modes (BDF 3 to 5 are not A-stable)
  double relative = 1e-6;        ///< relative tolerance of q and v
  double absolute = 1e-8;        ///< absolute tolerance of q
  double absolute_velocity = 0;  ///< absolute tolerance of v; 0: the one of q
  bool test_velocity = true;     ///< v takes part in the error test
  ErrorBudget budget = {};       ///< instead of these four
  /// The least speed at which friction is developed: Newton's iteration knows velocities to a tenth of it, whatever
  /// errors the tolerances allow, so that it cannot end on the wrong side.
  double slip_speed = std::numeric_limits<double>::infinity();
  bool scaled_constraints = false;  ///< constraint_tolerance is relative to the sizes of the equations; with a budget
  double initial_step = 0;          ///< 0: from the accelerations
  double max_step = std::numeric_limits<double>::infinity();
  double min_step = 0;  ///< 0: 1e-14 of the time scale
  /// > 0: constant step, no error test. With fixed_order > 2 the first points come from steps of variable length and
  /// order with a ten-thousandth of the tolerances, unless that takes too many of them.
  double fixed_step = 0;
  int fixed_order = 0;  ///< > 0: this order as soon as the history allows
  double constraint_tolerance =
      1e-10;            ///< of Phi; of the velocity and acceleration levels times max(1, |v|) and max(1, |a|)
  int max_newton = 12;  ///< iterations before a step is given up
  /// Newton error allowed, in units of the error tolerance; where `fixed_step` or `max_step` hold the step short of
  /// what the tolerance would allow, in units of the error that the formula itself makes in the step.
  double newton_tolerance = 0.01;
  double refactor_rate = 0.25;  ///< a slower convergence rate asks for a new factor at the next step
  double refactor_step = 0.3;   ///< so does a relative change of h/b0 since the factor
  DaeIteration iteration = DaeIteration::reduced;
  bool measure_blocks = false;  ///< evaluate every block of H after each step (dense; small systems)
  bool operator==(const BdfOptions&) const = default;
};

/// The integrator. Reduced iteration (docs/design/README.md): with h' = h/b0, W = F_a + h' F_v + h'^2 F_q and
/// K = [W Phi_q^T; Phi_q 0] of some recent state
///   R1 = v - theta_dot, R2 = a - (v - v^)/h',
///   dq = h' R1 + h'^2 R2 + y,         K [y; .] = [0; -Phi - Phi_q,K (h' R1 + h'^2 R2)]
///   at the new q:  dv = h' R2 + x,    K [x; .] = [0; -(Phi_q v - nu) - h' Phi_q,K R2]
///   at the new q, v: da = t + z,      K [t; dl_t] = [-F; 0], K [z; dl_z] = [0; -(Phi_q a - gamma)], dl = dl_t + dl_z,
///                                     v += h' t, q (+)= h'^2 t
/// which equals K [dq; mu] = [h' W (R1 + h' R2); -Phi] and so on, but needs no product with W. Every level is met at
/// the q and v that it depends on, and z, which is normal to the constraints, does not take v and q off them again:
/// the error of a pass is then that of W and Phi_q alone, and the derivatives of Phi_q v and gamma are not missed.
/// Non-holonomic constraints have no Phi: h' (Phi_q T(theta) theta_dot - nu) stands in its place, so that the formula
/// of q slips as little as v does. Once q and v are as good as the error test asks for, what is left of the three
/// levels is projected away without F.
///
/// Where the factor and flexible bodies lie on a GPU, the vectors of this iteration, the history and the error test
/// follow them (bdf_device.cpp). The host then sees what its joints and forces look at, and the whole state once a
/// step.
class BdfIntegrator final : public Integrator {
 public:
  BdfIntegrator(Equations& equations, const BdfOptions& options);

  void start(const State& state) override;
  /// Begins with known past points (oldest first, the last one is the current state): full order from the first step.
  void start(const std::vector<State>& past);
  StepReport step(double t_limit) override;
  [[nodiscard]] const State& state() const override { return state_; }
  [[nodiscard]] std::unique_ptr<Integrator> clone() const override;
  void save(std::vector<double>& out) override;
  void restore(ConstSpan& in) override;
  [[nodiscard]] int order() const { return order_; }
  /// Whether the vectors lie on a GPU.
  [[nodiscard]] bool on_device() const { return vectors_.on_device(); }
  /// Max norms of all blocks of H, with the dense U of the iteration in use.
  struct Blocks {
    double motion = 0, acceleration = 0, velocity = 0, position = 0;
    double tangential_v = 0;  ///< |h' U^T R2|: the BDF equation of v in the parameter space
    double tangential_q = 0;  ///< |h' U^T R1|
  };
  /// The blocks at the end of the last step. @pre options.measure_blocks
  [[nodiscard]] const Blocks& blocks() const { return blocks_; }

 private:
  enum class Outcome { converged, slow, diverged };
  struct Formula {
    int order = 1;
    double t = 0;   // end of the step
    double h = 0;   // its length
    double hp = 0;  // h' = h / b0
  };

  void allocate();
  void set_formula(double h, int order);
  void predict();
  void ensure_factor(bool retry);
  void renew_factor(long& reason);
  [[nodiscard]] double distance_from_factor();
  void error_weights();
  [[nodiscard]] double tolerance_of_position(std::size_t i, double size) const;
  [[nodiscard]] double tolerance_of_speed() const;
  [[nodiscard]] double tolerance_of_velocity(std::size_t i) const;
  void take_share();
  [[nodiscard]] double norm(ConstSpan x, ConstSpan weight) const;
  /// The norm of changes of q and v in dq_ and dv_, in units of the tolerance of the step.
  [[nodiscard]] double norm_of_change() const;
  void measure_constraints();
  [[nodiscard]] double largest_level(ConstSpan level) const;
  /// body(i) for each velocity coordinate, on all threads.
  template <class Body>
  void for_coordinates(const Body& body) const {
    for_each_entry(equations_.pool(), theta_.size(), body);
  }
  void combine_past(PastSums sums, ConstSpan weights);
  // Vectors on a GPU (bdf_device.cpp); without it the same calls serve the host.
  [[nodiscard]] MotionArrays arrays();
  [[nodiscard]] DeviceMotion& device_motion() const { return vectors_.device_motion(); }
  [[nodiscard]] const DeviceShare& share() const { return vectors_.share(); }
  /// loop(arrays, i) for each velocity coordinate, where it lies.
  template <class Loop>
  void run(const Loop& loop) {
    vectors_.run(arrays(), loop);
  }
  void fetch_for_host(std::initializer_list<MotionVector> vectors) {
    vectors_.fetch_for_host(arrays(), trial_, vectors);
  }
  [[nodiscard]] MotionRecord measure(const MotionMeasure& what) { return vectors_.measure(arrays(), what); }
  [[nodiscard]] bool may_enter_device() const;
  void enter_device();
  void leave_device();
  void push_there(bool in_place_of_newest);
  void error_weights_there();
  void place_factor_there();
  void predict_position();
  void move_position(MotionVector change);
  void chart_of_position();
  void velocity_of_rates();
  void residual_there();
  void solve_there();
  Outcome solve_step(StepReport& report);
  Outcome solve_augmented(StepReport& report);
  Outcome solve_reduced(StepReport& report);
  Outcome solve_full(StepReport& report);
  [[nodiscard]] bool turn_factor();
  void project_stages();
  void solve_normal();
  void add_normal_part(ConstSpan violation, MotionVector change);
  void iterate_reduced(StepReport& report);
  [[nodiscard]] bool multipliers_settle(const StepReport& report);
  [[nodiscard]] double rounding_of_change();
  [[nodiscard]] double allowed_change();
  [[nodiscard]] bool step_is_held() const;
  [[nodiscard]] bool has_freedom() const;
  [[nodiscard]] bool rounding_ends(double change, const StepReport& report);
  [[nodiscard]] double change_of_pass(StepReport& report);
  /// The change of a pass: the largest numbers and weighted squares.
  struct Change {
    double dq, dv, a, square_q, square_v;
  };
  [[nodiscard]] double change_of(const Change& all);
  [[nodiscard]] bool hopeless(double change, double rate, int iteration) const;
  // Near singular positions (bdf_projected.cpp)
  Outcome solve_projected(StepReport& report);
  void iterate_projected(StepReport& report);
  void remove_weak_parts();
  void rates_of_formula();
  void find_slip();
  void stage_residuals(const State& s);
  [[nodiscard]] bool constraints_hold(StepReport& report);
  [[nodiscard]] bool levels_of_motion_hold(double velocity, double acceleration);
  [[nodiscard]] bool finish_levels(StepReport& report);
  [[nodiscard]] double error_estimate(int order);
  [[nodiscard]] double unseen_share();
  [[nodiscard]] double growing_share();
  void measure_falling_masses(const std::vector<FallingForce>& forces);
  [[nodiscard]] bool first_points(double h, StepReport& report);
  [[nodiscard]] StepReport step_here(double t_limit);
  void continue_on_host(const Error& error);
  [[nodiscard]] bool attempt(double h, bool retry, StepReport& report);
  void begin_attempt(double h);
  [[nodiscard]] bool attempt_anywhere(double h, bool retry, StepReport& report);
  void check_step(double h, double t_limit) const;
  [[nodiscard]] bool sliver() const;  ///< whether the step that is being accepted is one
  void accept(StepReport& report);
  void choose_step(double error);
  [[nodiscard]] double first_step() const;
  [[nodiscard]] double clip(double h, double t_limit) const;
  void reject(double error, int failures);
  // Reference iteration (bdf_full.cpp)
  void measure_blocks();
  void parametrise();
  void full_residual(const State& s, std::vector<double>& out);
  void move(const State& from, ConstSpan dx, State& to) const;

  Equations& equations_;
  BdfOptions options_;
  std::vector<Switching*> switching_;   // laws of the system that switch
  std::vector<double> falling_masses_;  // of forces that fall with the speed, see growing_share()
  long falling_measured_ = 0;           // number of the step of it
  double growing_step_ = std::numeric_limits<double>::infinity();  // as long as what such forces drive is resolved
  SharedVectors vectors_;
  History history_;
  State state_;  // accepted
  State trial_;
  Formula formula_;
  int order_ = 1;
  double h_ = 0;
  double share_q_ = 1, share_v_ = 1;  // of the budget that the present step may have
  double newton_share_v_ = 1;         // of v, by which Newton's iteration is judged
  std::vector<double> row_sizes_;     // of the constraints; empty: all 1
  double longest_try_ = 0;            // of the present step
  int steps_at_order_ = 0;
  int projected_left_ = 0;                // steps that begin with the projected iteration
  int first_left_ = 0;                    // steps of first_points()
  std::shared_ptr<BdfIntegrator> first_;  // that takes them
  int noisy_left_ = 0;                    // steps until the points next to a singular position have left the history
  bool formula_is_projected_ = false;     // the trial state comes from the projected iteration
  double factor_hp_ = 0;                  // h' of the factor; 0: none
  bool factor_fresh_ = false;             // the factor belongs to this very attempt
  std::vector<double> factor_q_;          // configuration of the factor
  std::vector<double> placed_q_;          // to which it was turned
  bool turned_ = false;                   // the present attempt began with that
  double reach_ = std::numeric_limits<double>::infinity();  // learned: farther from placed_q_ the factor will not do
  bool rate_poor_ = false;
  double rate_ = 0.5;
  double own_error_ = 0, latest_error_ = 0;  // of the formula, in units of the tolerance; with memory, of the last pass
  bool tiny_ = false;                        // the last change of q and v may be rounding
  double level_of_a_ = 0;                    // the last change of a over a
  double size_q_ = 0;                        // largest coordinate
  double size_q_there_ = 0;                  // of those on a GPU
  double floor_ = 0;  // change at which the iteration stood still with a new factor, in the same units; 0: not met
  std::vector<double> theta_, theta_hat_, v_hat_, weight_q_, weight_v_;
  std::vector<double> r1_, r2_, dq_, dv_, f_, level_, work_n_, rhs_;
  Blocks blocks_;
  std::vector<double> u_;  // n x (n - m), column by column, for the reference iterations
};

}  // namespace espalier::dynamics
