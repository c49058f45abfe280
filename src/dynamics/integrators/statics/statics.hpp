/// \file
/// Static equilibrium, reached along a path of loads.
///
/// The load factor s multiplies gravity, loads, pressures and actuators (System::set_load_factor). What the given
/// configuration q0 has out of balance without them (prestressed springs, joints that do not fit, motors) comes in with
/// the same share, so that q0 is in equilibrium at s = 0 and the end of the path is the equilibrium asked for:
///   F(q, lambda; s) + Phi_q^T lambda - (1 - s / s_end) F(q0, 0; 0) = 0
///   Phi(q)                           - (1 - s / s_end) Phi(q0)     = 0
/// Functions of time are taken at the time of the state throughout.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/named.hpp"
#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics {

/// How the path is followed.
enum class StaticPath {
  automatic,   ///< load steps; arc length where they fail; relaxation where nothing holds the unloaded system, or where
               ///< the path breaks off without a limit point or bifurcation (contacts that let go)
  load_steps,  ///< the load factor only grows: a limit point is an error
  relaxation,  ///< no path: the whole load at once, damped like a motion (pseudo-transient continuation)
  linear       ///< none either: small displacements, see linear_statics.hpp
};
/// Without `linear`, which is a key of its own.
inline constexpr base::Named<StaticPath> kStaticPaths[] = {{"automatic", StaticPath::automatic},
                                                           {"load-steps", StaticPath::load_steps},
                                                           {"relaxation", StaticPath::relaxation}};

struct StaticsOptions {
  /// The tolerance of the residual, sqrt(sum r_i^2 / m_ii), relative to the largest of loads and reactions on the path;
  /// and of Phi, relative to the size of the system. What rounding keeps above it is accepted (Statics::at_rounding).
  double tolerance = 1e-9;
  double load = 1;                ///< load factor at the end
  double first_step = 0.1;        ///< of the load factor, relative to `load`
  double largest_step = 0.25;     ///< ... where Newton converges fast
  double smallest_step = 1e-6;    ///< ... below it the run gives up
  int max_steps = 1000;           ///< accepted steps; steps of the relaxation
  int max_iterations = 25;        ///< of Newton in one step
  int max_factorizations = 5000;  ///< of the whole search, with those of steps taken back
  double largest_turnback = 100;  ///< an arc that leads to a load factor below -largest_turnback is given up
  double pseudo_time = 0;         ///< first step of the relaxation; 0: from the size and the forces of the system
  StaticPath path = StaticPath::automatic;
  bool operator==(const StaticsOptions&) const = default;
};

/// An accepted step of the path.
struct StaticsStep {
  long index = 0;          ///< from 1
  double load = 0;         ///< load factor at its end
  double change = 0;       ///< of the load factor
  int iterations = 0;      ///< of Newton, in the attempt that succeeded
  int factorizations = 0;  ///< of all attempts
  int failures = 0;        ///< attempts that were rejected
  double residual = 0;     ///< in the units of the tolerance's reference: sqrt(sum r_i^2 / m_ii) / reference
  bool arc = false;        ///< by arc length
};

/// A point of the path where equilibrium is indifferent.
struct CriticalPoint {
  double load = 0;
  bool limit = true;  ///< limit point: the load factor turns back there. false: bifurcation (the path goes straight on)
};

struct StaticsResult {
  long steps = 0;
  int iterations = 0;
  double load = 0;      ///< load factor reached
  double residual = 0;  ///< |F + Phi_q^T lambda|, largest entry
  double position = 0;  ///< |Phi|, largest entry
  bool relaxed = false;
  std::vector<CriticalPoint> critical;
};

/// Called with every accepted step and the state there (its t is the time of the functions, not the load factor).
/// false: stop here.
using StaticsObserver = std::function<bool(const StaticsStep&, const State&)>;

/// What a search is at; a step may take long.
struct StaticsTrial {
  long steps = 0;          ///< accepted so far
  double load = 0;         ///< load factor of the last of them
  double trial = 0;        ///< load factor that is tried
  int factorizations = 0;  ///< so far
  double residual = 0;     ///< of the trial, as in StaticsStep
};

/// Called before every factorization. false: give up.
using StaticsWatch = std::function<bool(const StaticsTrial&)>;

/// Static equilibrium at the load factor options.load and the time state.t, from the given configuration on; v and a
/// become zero, lambda the reactions. Newton's method with backtracking on the natural level |K^-1 r| (Deuflhard,
/// Newton Methods for Nonlinear Problems, 2004, section 3.3): it does not take the stretch that a turning step gives to
/// slender members for a failure. Trials with inverted elements or forces that are no numbers are rejected.
/// Arc length: Riks' hyperplane (Int. J. Solids Struct. 15 (1979)), in the metric sum m_ii dq_i^2.
/// The load factor of the system is options.load afterwards, or that of the last state accepted where it throws.
/// @throws espalier::Error if no equilibrium is found: accuracy_not_reached, with the load factor and the place where
/// the iteration ended; cancelled if the watch gave up. state is the last equilibrium on the path
StaticsResult static_equilibrium(Equations& equations, State& state, const StaticsOptions& options = {},
                                 const StaticsObserver& observer = {}, const StaticsWatch& watch = {});

}  // namespace espalier::dynamics
