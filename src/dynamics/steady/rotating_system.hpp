/// \file
/// A system some bodies of which turn steadily about an axis, seen by statics: relative equilibria.
#pragma once

#include <vector>

#include "dynamics/steady/vector_coordinates.hpp"

namespace espalier::dynamics {

/// A steady rotation, global axes.
struct SteadyRotation {
  Vec3 point = Vec3::Zero();             ///< on the axis
  Vec3 rate = Vec3::Zero();              ///< angular velocity
  std::vector<const Component*> bodies;  ///< that turn
};

/// The same equations with v = w x (x - p) and a = w x v of the bodies that turn, in the place of the state's: an
/// equilibrium of it is a motion in which they turn as rigid bodies, strained by what their rotation asks for
/// (centrifugal forces, moments of gyroscopes). Its tangent by q has what follows from that. The load factor multiplies
/// accelerations, as it does loads.
class RotatingSystem final : public System {
 public:
  /// @param system  outlives the object
  RotatingSystem(AssembledSystem& system, SteadyRotation rotation);
  /// v and a of the rotation at a configuration, with the load factor; zero of other bodies.
  void set_motion(ConstSpan q, Span v, Span a) const;

  [[nodiscard]] Sizes sizes() const override { return system_.sizes(); }
  [[nodiscard]] std::string constraint_name(Index row) const override { return system_.constraint_name(row); }
  [[nodiscard]] std::span<const Index> non_holonomic() const override { return system_.non_holonomic(); }
  [[nodiscard]] std::string coordinate_name(Index coordinate) const override {
    return system_.coordinate_name(coordinate);
  }
  void retract(ConstSpan q, ConstSpan dq, Span q_out) const override { system_.retract(q, dq, q_out); }
  void local(ConstSpan base, ConstSpan q, Span theta) const override { system_.local(base, q, theta); }
  void velocity_of_rate(ConstSpan theta, ConstSpan theta_dot, Span v) const override {
    system_.velocity_of_rate(theta, theta_dot, v);
  }
  void rate_of_velocity(ConstSpan theta, ConstSpan v, Span theta_dot) const override {
    system_.rate_of_velocity(theta, v, theta_dot);
  }
  void carry(ConstSpan theta, std::span<const Span> vectors) const override { system_.carry(theta, vectors); }
  void magnitude(ConstSpan q, Span out) const override { system_.magnitude(q, out); }
  void residual(const StateView& s, Span f) override;
  void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) override {
    system_.constraints(t, q, v, out);
  }
  [[nodiscard]] Energy energy(const StateView& s) override { return system_.energy(s); }
  void set_load_factor(double factor) override;
  void accept(const StateView& s) override { system_.accept(s); }
  bool augment(const StateView& s) override { return system_.augment(s); }
  [[nodiscard]] const SparsePattern& tangent_pattern() const override { return pattern_; }
  [[nodiscard]] const SparsePattern& constraint_pattern() const override { return system_.constraint_pattern(); }
  [[nodiscard]] std::uint64_t pattern_version() const override { return system_.pattern_version(); }
  void update_pattern(ConstSpan q) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  [[nodiscard]] const SparsePattern* multiplier_pattern() const override { return system_.multiplier_pattern(); }
  void multiplier_tangent(const StateView& s, Span values) override;

 private:
  void lay_out();
  [[nodiscard]] StateView turning(const StateView& s);

  AssembledSystem& system_;
  SteadyRotation rotation_;
  std::vector<VectorCoordinates> vectors_;  // of the bodies that turn
  double factor_ = 1;
  SparsePattern pattern_;          // the system's, and all columns of a vector with the rows of each of them
  std::vector<Offset> positions_;  // of the system's entries in it
  std::uint64_t version_ = 0;
  std::vector<double> v_, a_, mass_, damping_, own_;
};

}  // namespace espalier::dynamics
