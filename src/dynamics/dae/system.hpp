/// \file
/// The seam of the dynamics module: a mechanical system as a set of equations in the unknowns x = [a, v, q, lambda].
///
/// Words used everywhere below
///   v         velocity coordinates, n of them; a = dv/dt
///   q         configuration, n_q >= n numbers (rigid body: 7 for 6 velocity coordinates, position and unit quaternion)
///   dq        an increment of the configuration: a tangent vector with n entries, in the same coordinates as v dt
///   q (+) dq  the configuration reached from q by the increment dq (retraction); plain addition in a vector space
///   m         number of constraint equations
/// The equations
///   F(q, v, a, lambda, t) + Phi_q^T lambda = 0    motion; residual() gives F, the layer itself adds Phi_q^T lambda
///   Phi(q, t) = 0                                 position level
///   Phi_q v   - nu = 0       nu = -Phi_t          velocity level
///   Phi_q a   - gamma = 0                         acceleration level, gamma = -(d/dt Phi_q) v - d/dt Phi_t
/// where Phi_q is the derivative with respect to increments: Phi(q (+) dq) = Phi(q) + Phi_q dq + O(dq^2).
/// Derivatives of F with respect to q are meant in the same way, and contain the derivative of Phi_q^T lambda.
/// F may depend on lambda itself (friction that grows with a joint's reaction): F_lambda then stands beside Phi_q^T.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dynamics/dae/pattern.hpp"
#include "espalier/dae.hpp"

namespace espalier::dynamics {

using Span = std::span<double>;
using ConstSpan = std::span<const double>;

/// What a call of constraints() shall fill in. An empty span is not wanted (and then not computed).
struct ConstraintBuffers {
  Span phi;           ///< m: Phi(q, t)
  Span nu;            ///< m: right side of the velocity level
  Span gamma;         ///< m: right side of the acceleration level (needs v)
  Span phi_q_values;  ///< entries of Phi_q in the order of its pattern
};

struct Sizes {
  Index configuration = 0;  ///< n_q
  Index velocity = 0;       ///< n
  Index constraints = 0;    ///< m
};

/// A body's turn between two configurations: x_to - centre = rotation (x_from - centre), but for its strain.
struct BodyTurn {
  Index first = 0;                                            ///< first velocity coordinate of the body
  Index vertices = 0;                                         ///< that many times three coordinates turn with it
  std::array<double, 9> rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< row by row
};

/// A system of equations that the integrators can integrate. All arrays are global. Implementations need not be safe
/// for concurrent calls on one object.
class System {
 public:
  virtual ~System() = default;

  [[nodiscard]] virtual Sizes sizes() const = 0;
  /// Name of a constraint equation for people, for instance: revolute "hinge-3", rotation about y.
  [[nodiscard]] virtual std::string constraint_name(Index row) const;
  /// Constraint equations, ascending, that hold for velocities alone: A(q) v = nu with A in the place of Phi_q, nothing
  /// on the position level (Phi = 0). There the integrators ask for the same of the displacement of a step; see
  /// Equations::set_slip().
  [[nodiscard]] virtual std::span<const Index> non_holonomic() const { return {}; }
  /// Name of a velocity coordinate for people.
  [[nodiscard]] virtual std::string coordinate_name(Index coordinate) const;

  // The manifold of configurations; the defaults are those of a vector space (n_q = n).
  /// q_out = q (+) dq. q_out may alias q.
  virtual void retract(ConstSpan q, ConstSpan dq, Span q_out) const;
  /// theta with q = base (+) theta (the inverse of retract in its second argument).
  virtual void local(ConstSpan base, ConstSpan q, Span theta) const;
  /// v of a motion base (+) theta(t): v = T(theta) theta_dot. v may alias theta_dot.
  virtual void velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const;
  /// Its inverse: theta_dot = T(theta)^-1 v. theta_dot may alias v.
  virtual void rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const;
  /// Velocities in the axes of q, each as seen in those of q (+) theta: x := T(-theta)^-1 T(theta) x.
  virtual void carry(ConstSpan /*theta*/, std::span<const Span> /*vectors*/) const {}
  /// Magnitude of each coordinate for relative tolerances: |q_i| by default, 1 for a rotation. n entries.
  virtual void magnitude(ConstSpan q, Span out) const;

  // Equations.
  /// F(q, v, a, lambda, t) without Phi_q^T lambda; overwrites f (n).
  virtual void residual(const StateView& s, Span f) = 0;
  /// Constraint quantities at (t, q, v); v may be empty unless gamma is wanted. Does nothing where m = 0.
  virtual void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) = 0;
  [[nodiscard]] virtual Energy energy(const StateView& s);
  /// Multiplies gravity, loads, pressures and actuators from now on (1 unless statics puts them on step by step).
  virtual void set_load_factor(double /*factor*/) {}
  /// How bodies whose tangents turn with them have turned from a configuration to another one.
  [[nodiscard]] virtual std::vector<BodyTurn> turns(ConstSpan /*from*/, ConstSpan /*to*/) const { return {}; }
  /// Called by the integrators with every accepted state: the place to remember what has a history (turns of an angle).
  virtual void accept(const StateView& /*s*/) {}
  /// Called where the equations hold at a trial state: whether multipliers that the system keeps to itself (augmented
  /// Lagrangian) were changed, so that they are to be solved again from there.
  virtual bool augment(const StateView& /*s*/) { return false; }

  // Jacobians. The patterns are fixed while pattern_version() stays the same.
  [[nodiscard]] virtual const SparsePattern& tangent_pattern() const = 0;     ///< n x n, by columns
  [[nodiscard]] virtual const SparsePattern& constraint_pattern() const = 0;  ///< m x n, by rows
  [[nodiscard]] virtual std::uint64_t pattern_version() const { return 0; }
  /// Called before W is evaluated at a configuration: the place to make the patterns anew (and to raise
  /// pattern_version()) where bodies have come near each other whose entries they lack.
  virtual void update_pattern(ConstSpan /*q*/) {}
  /// W = weights.a F_a + weights.v F_v + weights.q (F + Phi_q^T lambda)_q; overwrites the values.
  virtual void tangent(const StateView& s, const TangentWeights& weights, Span w_values) = 0;
  /// Pattern of F_lambda, n x m, by columns. Null: F does not depend on lambda.
  [[nodiscard]] virtual const SparsePattern* multiplier_pattern() const { return nullptr; }
  /// F_lambda without Phi_q^T; overwrites the values. Called where multiplier_pattern() is not null.
  virtual void multiplier_tangent(const StateView& /*s*/, Span /*values*/) {}
};

}  // namespace espalier::dynamics
