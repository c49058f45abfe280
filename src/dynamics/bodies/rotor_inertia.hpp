/// \file
/// The inertia of what turns or slides with one relative coordinate of two frames alone: the rotor of a motor behind a
/// gear, which is felt at the joint and nowhere else.
#pragma once

#include <array>

#include "dynamics/dae/component.hpp"
#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

/// One coordinate x with m x'' = 0; a constraint makes it follow the coordinate of a joint.
class RotorInertia final : public Component {
 public:
  /// @param inertia  mass, or moment of inertia where x is an angle @param speed  x' at the start, where x is 0
  /// @throws std::invalid_argument if the inertia is not positive and finite
  RotorInertia(std::string name, double inertia, double speed = 0);

  [[nodiscard]] const std::array<Index, 1>& coordinates() const { return coordinates_; }
  [[nodiscard]] double position(ConstSpan q) const { return q[static_cast<std::size_t>(placement().q)]; }
  [[nodiscard]] double speed(ConstSpan v) const { return v[static_cast<std::size_t>(placement().v)]; }

  [[nodiscard]] Sizes sizes() const override { return {1, 1, 0}; }
  void place(const Placement& at) override;
  void initial(Span q, Span v) const override;
  [[nodiscard]] std::string coordinate_name(Index local_coordinate) const override;
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  [[nodiscard]] Energy energy(const StateView& s) override;

 private:
  double inertia_, speed_;
  std::array<Index, 1> coordinates_{};
  Offset position_ = 0;
};

/// An origin that is x away from the global one along z: what joints know of the coordinate.
class RotorFrame final : public Frame {
 public:
  explicit RotorFrame(const RotorInertia& rotor) : rotor_(&rotor) {}
  [[nodiscard]] std::span<const Index> coordinates() const override { return rotor_->coordinates(); }
  [[nodiscard]] bool has_rotation() const override { return false; }
  [[nodiscard]] bool turns(std::size_t /*k*/) const override { return false; }
  void motion(ConstSpan q, ConstSpan v, FrameMotion& out) const override;
  void jacobian(ConstSpan q, double* j) const override;

 private:
  const RotorInertia* rotor_;
};

}  // namespace espalier::dynamics
