/// \file
/// Point masses: bodies that have a place and no axes.
#pragma once

#include <array>

#include "dynamics/dae/component.hpp"
#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

struct PointMassData {
  double mass = 1;
  Vec3 position = Vec3::Zero();
  Vec3 velocity = Vec3::Zero();
  Vec3 gravity = Vec3::Zero();  ///< acceleration of gravity
};

/// A mass in a point: three coordinates, m (a - g) = 0.
class PointMass final : public Component {
 public:
  /// @throws std::invalid_argument if the mass is not positive, or a number is not finite
  PointMass(std::string name, const PointMassData& data);

  [[nodiscard]] const PointMassData& data() const { return data_; }
  [[nodiscard]] Vec3 position(ConstSpan q) const { return three(q, placement().q); }
  [[nodiscard]] Vec3 velocity(ConstSpan v) const { return three(v, placement().v); }
  [[nodiscard]] const std::array<Index, 3>& coordinates() const { return coordinates_; }

  [[nodiscard]] Sizes sizes() const override { return {3, 3, 0}; }
  void place(const Placement& at) override;
  [[nodiscard]] std::string coordinate_name(Index local_coordinate) const override;
  void initial(Span q, Span v) const override;
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  [[nodiscard]] Energy energy(const StateView& s) override;

 private:
  [[nodiscard]] static Vec3 three(ConstSpan x, Index first) {
    const auto i = static_cast<std::size_t>(first);
    return {x[i], x[i + 1], x[i + 2]};
  }

  PointMassData data_;
  std::array<Index, 3> coordinates_{};
  std::array<Offset, 3> mass_position_{};
};

/// The frame of a point mass: an origin without axes of its own.
class PointFrame final : public Frame {
 public:
  explicit PointFrame(const PointMass& body) : body_(&body) {}
  [[nodiscard]] std::span<const Index> coordinates() const override { return body_->coordinates(); }
  [[nodiscard]] bool has_rotation() const override { return false; }
  [[nodiscard]] bool turns(std::size_t /*k*/) const override { return false; }
  void motion(ConstSpan q, ConstSpan v, FrameMotion& out) const override;
  void jacobian(ConstSpan q, double* j) const override;

 private:
  const PointMass* body_;
};

}  // namespace espalier::dynamics
