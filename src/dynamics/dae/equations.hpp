/// \file
/// A system together with its Newton matrix: what every integrator works with.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/dae/kkt.hpp"
#include "dynamics/dae/phase.hpp"
#include "dynamics/dae/system_on_device.hpp"

namespace espalier::dynamics {

/// A state that owns its arrays.
struct State {
  double t = 0;
  std::vector<double> q, v, a, lambda;
  State() = default;
  explicit State(const Sizes& s)
      : q(at(s.configuration)), v(at(s.velocity)), a(at(s.velocity)), lambda(at(s.constraints)) {}
  [[nodiscard]] StateView view() const { return {t, q, v, a, lambda}; }
};

/// Largest violations of the four sets of equations, dropped constraints left out.
struct Levels {
  double motion = 0;        ///< |F + Phi_q^T lambda|
  double position = 0;      ///< |Phi|
  double velocity = 0;      ///< |Phi_q v - nu|
  double acceleration = 0;  ///< |Phi_q a - gamma|
};

/// Counts and wall times since construction.
struct EquationCounts {
  long residuals = 0;       ///< evaluations of F
  long constraints = 0;     ///< evaluations of constraint quantities
  long tangents = 0;        ///< assemblies of W
  long analyses = 0;        ///< symbolic analyses
  long factorizations = 0;  ///< numeric factorizations
  long turns = 0;           ///< factors that were turned
  long solves = 0;          ///< right sides solved for
  double assembly_seconds = 0;
  double analysis_seconds = 0;  ///< the first factorization of a pattern with its analysis, and a GPU's tables
  double factor_seconds = 0;
  double solve_seconds = 0;
};

/// Evaluates the levels of the equations at a trial state and solves with K. One object serves one system; not safe for
/// concurrent calls.
class Equations {
 public:
  /// Takes the default solver for the size of the system, or `solver`. @param pool  see set_pool()
  explicit Equations(System& system, std::unique_ptr<LinearSolver> solver = nullptr, base::ThreadPool* pool = nullptr);
  ~Equations() { leave_device(); }
  Equations(const Equations&) = delete;
  Equations& operator=(const Equations&) = delete;

  [[nodiscard]] System& system() { return system_; }
  [[nodiscard]] const Sizes& sizes() const { return sizes_; }
  /// Looks at pattern_version() and lays K out anew if it changed; true if it did.
  bool update_pattern();
  /// Constraints to be left out (m entries, non-zero = out); empty: none.
  void set_dropped(std::vector<char> dropped);
  [[nodiscard]] const std::vector<char>& dropped() const { return dropped_; }

  /// Fills phi(), nu(), phi_q() at (t, q), and gamma() too where v is not empty.
  void evaluate_constraints(double t, ConstSpan q, ConstSpan v);
  /// Fills gamma() at (t, q, v) alone. @pre the others were evaluated at (t, q)
  void evaluate_gamma(double t, ConstSpan q, ConstSpan v);
  [[nodiscard]] ConstSpan phi() const { return phi_; }
  [[nodiscard]] ConstSpan nu() const { return nu_; }
  [[nodiscard]] ConstSpan gamma() const { return gamma_; }
  [[nodiscard]] ConstSpan phi_q() const { return phi_q_; }
  /// phi() of the non-holonomic constraints := (Phi_q rate - nu) time, the way of slip with that rate of q: in the
  /// place of a position level, which they do not have. Does nothing where there are none.
  /// @pre the others were evaluated
  void set_slip(ConstSpan rate, double time);
  [[nodiscard]] bool has_non_holonomic() const { return !system_.non_holonomic().empty(); }
  /// out = Phi_q x - shift with the last evaluated Phi_q; zero in dropped rows. shift may be empty.
  void level(ConstSpan x, ConstSpan shift, Span out) const;
  /// f = F + Phi_q^T lambda with the last evaluated Phi_q.
  void motion(const StateView& s, Span f);
  /// The same on a GPU: s holds what DeviceShare says is seen there, or not the bodies', `there` the bodies' part.
  /// @param f  n numbers of the host, of which those of DeviceShare::own are f when it returns; scratch else
  /// @param f_there  the bodies' part, in the GPU's memory, without those that are not theirs
  void motion_there(const StateView& s, const StateView& there, Span f, double* f_there);
  /// All four levels at a state (evaluates everything).
  [[nodiscard]] Levels levels(const StateView& s);

  /// Factorizes K with W = weights.a F_a + ... at the state and the last evaluated Phi_q.
  /// @throws espalier::Error that names the coordinate or constraint if K is singular.
  /// @param there  see motion_there(); null: s holds all. Where the GPU has no factor any more, an Error(device_error)
  ///   asks for all of s.
  void factorize(const StateView& s, const TangentWeights& weights, const StateView* there = nullptr);
  /// Lets the factor stand for K at the state, to which bodies have turned from the configuration of the factor, with
  /// the last evaluated Phi_q; see TurnedFactor. @return false: it cannot, or a new factor is cheaper
  [[nodiscard]] bool turn_factor(ConstSpan q_of_factor, ConstSpan q);
  /// Factorizes [identity-like metric; Phi_q]: K with W = F_a, for projections. Same as factorize with {1, 0, 0}.
  [[nodiscard]] KktSolver& kkt() { return kkt_; }
  /// Threads for K and for what integrators do with long vectors; outlives the object; null: the calling thread alone.
  void set_pool(base::ThreadPool* pool);
  [[nodiscard]] base::ThreadPool* pool() const { return pool_; }
  /// What comes is recorded there; outlives the object; null: nowhere.
  void set_trace(PhaseTrace* trace) { trace_ = trace; }
  /// From now on a GPU that has the factor also evaluates what it can of F and W, as soon as there is a factor; see
  /// device/device_assembly.hpp. Where its memory is too small, or it fails, the host goes on alone and says so in
  /// device_notice().
  /// @param make  what makes it
  using MakeDevice = std::unique_ptr<DeviceAssembly> (*)(const GpuPlaces& places, base::ThreadPool* pool);
  void allow_device(MakeDevice make = make_device_assembly);
  [[nodiscard]] bool on_device() const { return device_ != nullptr; }
  /// See SystemOnDevice.
  [[nodiscard]] const DeviceShare* device_share() const {
    return on_device_system_ == nullptr ? nullptr : on_device_system_->device_share();
  }
  [[nodiscard]] const std::string& device_notice() const { return device_notice_; }
  /// Vectors of an integrator on the GPU that has factor and bodies, for one integrator at a time.
  /// @param ticket  made the number that stands for them
  /// @return null: they stay with the host
  [[nodiscard]] DeviceMotion* claim_motion(const MotionDemand& demand, long& ticket);
  /// After an error of the GPU in that memory: it is given back, and nobody gets it any more.
  void give_motion_up(const Error& error);
  /// @return null: they are another one's, or gone
  [[nodiscard]] DeviceMotion* motion_of(long ticket) const { return ticket == ticket_ ? motion_.get() : nullptr; }
  /// Forgets factor and analysis: what comes depends on the coming matrices alone, not on those before.
  void forget_analysis();
  /// Solves with K in place; b holds `columns` pieces of n + m numbers, of which the last `normal` ones have n zeros.
  void solve(Span b, Index columns = 1, Index normal = 0);
  /// KktSolver's of the same names.
  void solve_there(double* x);
  void solve_normal_there(ConstSpan r, double* x);

  [[nodiscard]] const EquationCounts& counts() const { return counts_; }

 private:
  void try_device();
  void leave_device();
  [[nodiscard]] bool give_device_up(const Error& error);
  void assemble(const StateView& s, const TangentWeights& weights, bool on_device, const StateView* there);
  [[nodiscard]] bool factorize_assembled(const StateView& s, bool on_device);

  System& system_;
  SystemOnDevice* on_device_system_;  // the same; null: it has nothing for a GPU
  Sizes sizes_;
  std::unique_ptr<DeviceAssembly> device_;  // outlives what lies on it: a part of K, and of the system (leave_device())
  MakeDevice make_device_ = nullptr;        // null: not allowed
  std::unique_ptr<DeviceMotion> motion_;    // on device_
  MotionDemand motion_demand_;
  long ticket_ = 0;  // of motion_
  bool motion_allowed_ = true;
  base::ThreadPool* pool_ = nullptr;
  PhaseTrace* trace_ = nullptr;
  std::string device_notice_;
  KktSolver kkt_;
  std::uint64_t version_ = 0;
  bool have_pattern_ = false;
  bool first_factorization_ = true;
  std::vector<char> dropped_;
  std::vector<double> phi_, nu_, gamma_, phi_q_;
  std::vector<double> work_n_, work_m_;
  EquationCounts counts_;
};

/// Largest absolute value; 0 for an empty span.
[[nodiscard]] double max_norm(ConstSpan x);

/// The solver that suits a system of `unknowns` = n + m rows.
[[nodiscard]] std::unique_ptr<LinearSolver> make_linear_solver(Index unknowns);

}  // namespace espalier::dynamics
