/// \file
/// The generic layer of the simulator: give a mechanical system as functions and integrate it.
///
/// Unknowns: n coordinates q (a vector space) with velocities v = dq/dt and accelerations a = dv/dt, and m multipliers
/// lambda. Equations, with Phi_q = dPhi/dq:
///     F(t, q, v, a, lambda) + Phi_q^T lambda = 0     motion; F = M(q) a - f(t, q, v) in the usual case
///     Phi(t, q) = 0                                  constraints, and
///     Phi_q v + Phi_t = 0,   Phi_q a - gamma = 0     their first and second derivatives in time,
///                                                    gamma = -(d/dt Phi_q) v - d/dt Phi_t
/// All three levels of the constraints hold at the end of every step of the BDF method. Redundant constraints are
/// found, named and left out.
///
///     espalier::DaeFunctions f;                       // see examples/slider_crank.cpp
///     f.coordinates = 2, f.constraints = 1, f.mass = ..., f.force = ..., f.constraint = ...;
///     espalier::Dae dae(f);
///     if (auto s = dae.start(0, q, v); !s.ok()) ...   // makes q and v consistent
///     if (auto s = dae.integrate(1.0); !s.ok()) ...
///     double x = dae.state().q[0];
///
/// All indices count from 0, all quantities are in one consistent system of units of the caller's choice. Spans given
/// to a function belong to the library and are valid during the call.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "espalier/solver.hpp"

namespace espalier {

/// Where the motion stands. Views only; `a` and `lambda` may be empty where a function does not use them.
struct StateView {
  double t = 0;                    ///< time
  std::span<const double> q;       ///< configuration; n numbers of a system of functions
  std::span<const double> v;       ///< velocities, n
  std::span<const double> a;       ///< accelerations, n
  std::span<const double> lambda;  ///< multipliers, m
};

/// Weights of the three derivatives in a tangent: W = a F_a + v F_v + q (F + Phi_q^T lambda)_q.
struct TangentWeights {
  double a = 1;
  double v = 0;
  double q = 0;
};

/// Energies in the units of the model. Work of external and dissipative forces is not counted.
struct Energy {
  double kinetic = 0;
  double potential = 0;
  [[nodiscard]] double total() const { return kinetic + potential; }
};

/// The entries of a matrix, to be filled in by a function of the user; all are zero when it is called.
class MatrixEntries {
 public:
  /// A dense matrix: `data` holds rows x cols numbers, column by column or row by row.
  MatrixEntries(double* data, Index rows, Index cols, bool by_columns)
      : data_(data), rows_(rows), cols_(cols), by_columns_(by_columns) {}
  /// A sparse matrix in compressed form with rising indices: `ptr` runs over columns or rows, `ind` holds the others.
  MatrixEntries(double* data, Index rows, Index cols, bool by_columns, const Offset* ptr, const Index* ind)
      : data_(data), rows_(rows), cols_(cols), by_columns_(by_columns), ptr_(ptr), ind_(ind) {}

  /// Entry (row, col), 0-based. Takes log2 of the entries of a column (row) where the pattern is sparse.
  /// @throws std::logic_error if it lies outside of the matrix or was not declared in the pattern
  double& operator()(Index row, Index col);
  [[nodiscard]] Index rows() const { return rows_; }
  [[nodiscard]] Index cols() const { return cols_; }

 private:
  double* data_;
  Index rows_, cols_;
  bool by_columns_;
  const Offset* ptr_ = nullptr;
  const Index* ind_ = nullptr;
};

/// The system as functions. What they write to is zero when they are called. Either `mass` and `force` (F = M a - f) or
/// `residual` must be given, and `constraint` where there are constraints. Every derivative that is left empty is made
/// by central differences, which costs some digits and evaluations; those that are given can be checked with
/// Dae::check_jacobians().
struct DaeFunctions {
  Index coordinates = 0;  ///< n > 0
  Index constraints = 0;  ///< m >= 0

  std::function<void(std::span<const double> q, MatrixEntries m)> mass;  ///< M(q), n x n
  std::function<void(double t, std::span<const double> q, std::span<const double> v, std::span<double> f)>
      force;                                                              ///< f(t, q, v), n
  std::function<void(const StateView& s, std::span<double> f)> residual;  ///< F, n; without Phi_q^T lambda
  std::function<void(const StateView& s, const TangentWeights& weights, MatrixEntries w)> tangent;  ///< W, n x n

  std::function<void(double t, std::span<const double> q, std::span<double> phi)> constraint;         ///< Phi, m
  std::function<void(double t, std::span<const double> q, MatrixEntries phi_q)> constraint_jacobian;  ///< Phi_q, m x n
  std::function<void(double t, std::span<const double> q, std::span<double> phi_t)>
      constraint_rate;  ///< Phi_t, m; empty: Phi does not depend on t
  std::function<void(double t, std::span<const double> q, std::span<const double> v, std::span<double> gamma)>
      constraint_gamma;  ///< gamma, m

  std::function<Energy(const StateView& s)> energy;  ///< for Dae::energy(); empty: zero
  std::vector<std::string> constraint_names;         ///< for messages; empty, or one for each constraint

  /// (row, col) of every entry of W (M included, where it is given) and of Phi_q that may ever be other than zero;
  /// repeats are fine. Empty: all, which suits up to some hundred unknowns. Differences take one evaluation (two calls)
  /// for every group of columns without a common row.
  std::vector<std::pair<Index, Index>> tangent_pattern, constraint_pattern;
};

/// Largest differences between what a system states of its derivatives and central differences, each relative to the
/// largest entry of the matrix concerned (or 1). Differences themselves are good to about 1e-9.
struct JacobianCheck {
  double f_a = 0;       ///< dF/da
  double f_v = 0;       ///< dF/dv
  double f_q = 0;       ///< d(F + Phi_q^T lambda)/dq
  double phi_q = 0;     ///< Phi_q against Phi(t, q)
  double nu = 0;        ///< Phi_t against Phi(t, q)
  double gamma = 0;     ///< gamma against d/dt (Phi_q v + Phi_t) along the motion
  double f_lambda = 0;  ///< dF/dlambda + Phi_q^T against F + Phi_q^T lambda
  double chart = 0;     ///< of systems whose configurations are no vector space: 0 for functions
  std::string worst;    ///< names the entry of the largest of them
  [[nodiscard]] double largest() const;
};

/// bdf: orders 1 to 5, variable step and order, all three levels of the constraints. generalized_alpha: constant step,
/// second order, numerical damping, constraints on position level.
enum class DaeMethod { bdf, generalized_alpha };

/// How bdf solves the equations of a step. `reduced` is the one to use; the others are references that work on dense
/// matrices of 3 n + m unknowns.
enum class DaeIteration {
  reduced,       ///< three solves with K of size n + m per iteration; U = W^T N is implied by K
  full_matched,  ///< Newton on the 3n + m system with explicit U = W^T N of the same K: must agree with `reduced`
  full_tangent,  ///< Newton on the 3n + m system, U = orthonormal basis of the tangent space (QR of Phi_q^T)
  full_boolean,  ///< Newton on the 3n + m system, U = independent coordinates (LU of Phi_q with full pivoting)
};

/// All options of both methods. Those that say so belong to one of them; the other does not look at them.
struct DaeOptions {
  DaeMethod method = DaeMethod::bdf;
  double relative = 1e-6;        ///< bdf: tolerance of q and v per step
  double absolute = 1e-8;        ///< bdf: of q
  double absolute_velocity = 0;  ///< bdf: of v; 0: that of q
  bool test_velocity = true;     ///< bdf: v takes part in the error test
  int max_order = 5;             ///< bdf: 1 to 5; 2 for stiff systems with little damping (3 to 5 are not A-stable)
  int order = 0;                 ///< bdf: > 0: this order as soon as there are points enough
  double step = 0;               ///< > 0: constant step without error test; generalized_alpha needs it
  double initial_step = 0;       ///< bdf: 0: found
  double min_step = 0;           ///< bdf: 0: 1e-14 of the time scale
  double max_step = std::numeric_limits<double>::infinity();  ///< bdf
  double spectral_radius = 0.8;         ///< generalized_alpha: at infinite frequency: 1 no damping, 0 most
  std::optional<double> hht_alpha;      ///< generalized_alpha: the HHT method with this alpha, in [-1/3, 0], instead
  double constraint_tolerance = 1e-10;  ///< of Phi; of the other levels (bdf) times max(1, |v|) and max(1, |a|)
  int max_newton = 0;                   ///< iterations before a step is given up; 0: 12 (bdf) or 15
  /// Error that the end of Newton's iteration may leave, in units of the tolerance (bdf with variable steps) or of the
  /// error that the method itself makes in a step (constant steps): the smaller the step, the more it asks for. Where
  /// rounding does not allow that, DaeStep::rounding says so.
  double newton_tolerance = 0.01;
  double newton_change = 1e-8;  ///< generalized_alpha: and at most so much of q and h v, relative to |q| + 1
  double refactor_rate = 0.25;  ///< a slower convergence rate of Newton asks for a new factor at the next step
  double refactor_step = 0.3;   ///< bdf: so does a larger relative change of h/b0
  DaeIteration iteration = DaeIteration::reduced;                     ///< bdf
  double allowed_position = std::numeric_limits<double>::infinity();  ///< change of q that start() may need
  double allowed_velocity = std::numeric_limits<double>::infinity();  ///< change of v
  std::optional<Options> solver;  ///< of Newton's matrices; none: dense up to 60 unknowns, else the defaults for them
};

/// One accepted step.
struct DaeStep {
  long index = 0;             ///< from 1
  double t = 0;               ///< time at its end
  double h = 0;               ///< its length
  int order = 0;              ///< of the formula
  int newton_iterations = 0;  ///< of the attempt that succeeded
  int factorizations = 0;     ///< of all attempts
  double error = 0;           ///< local error in units of the tolerance; 0 where it is not tested
  /// Where rounding ended Newton's iteration before newton_tolerance was reached: its last change of accelerations and
  /// multipliers in units of the largest; 0 elsewhere. Smaller steps make it larger.
  double rounding = 0;
};

/// What a run did.
struct DaeSummary {
  long steps = 0, newton_iterations = 0, error_failures = 0, newton_failures = 0;
  long residuals = 0, tangents = 0, analyses = 0, factorizations = 0, solves = 0;
  double assembly_seconds = 0, analysis_seconds = 0, factorization_seconds = 0, solve_seconds = 0;
  double largest_position = 0;  ///< largest violation |Phi| at the end of a step, and of the other levels
  double largest_velocity = 0, largest_acceleration = 0;
  long rounded = 0;                    ///< steps in which rounding ended Newton's iteration
  double largest_rounding = 0;         ///< DaeStep::rounding of them
  long divisions = 0;                  ///< halvings of generalized_alpha's step where Newton failed
  Index degrees_of_freedom = 0;        ///< n - rank(Phi_q)
  std::vector<std::string> redundant;  ///< one line for each constraint left out
};

/// One system and its motion. Owns the functions and all arrays. Not safe for concurrent calls.
/// Expected failures (no consistent start, no step succeeds, contradicting constraints, memory) come back as Status;
/// wrong use throws std::invalid_argument or std::logic_error; what the functions throw passes through.
class Dae {
 public:
  /// @throws std::invalid_argument if functions are missing or options make no sense
  explicit Dae(DaeFunctions functions, DaeOptions options = {});
  ~Dae();
  Dae(Dae&&) noexcept;
  Dae& operator=(Dae&&) noexcept;

  /// Begins at time t: q and v (n each) are moved to the nearest ones that satisfy the constraints, accelerations and
  /// multipliers follow from the equations of motion. @throws std::invalid_argument for wrong sizes
  Status start(double t, std::span<const double> q, std::span<const double> v);
  /// Steps until exactly t_end; may be called again with a later one. `observe`, if given, is called after every step
  /// and ends the call by returning false. @pre start() succeeded
  Status integrate(double t_end, const std::function<bool(const DaeStep&)>& observe = {});

  /// The present state: after start() and after every step. Valid until the next call of start() or integrate().
  [[nodiscard]] StateView state() const;
  /// DaeFunctions::energy at the present state.
  [[nodiscard]] Energy energy() const;
  /// Compares every derivative that was given with central differences at the present state. O(n) evaluations.
  [[nodiscard]] JacobianCheck check_jacobians() const;
  /// The same at a state of the caller's choice, which need not satisfy any equation.
  [[nodiscard]] JacobianCheck check_jacobians(const StateView& s) const;
  [[nodiscard]] DaeSummary summary() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace espalier
