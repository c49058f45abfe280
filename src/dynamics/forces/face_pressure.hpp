/// \file
/// Pressure on faces of a solid, or the factor of a load per length, as a function of the state.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/dae/capabilities.hpp"
#include "dynamics/forces/force_inputs.hpp"
#include "dynamics/forces/pressed_faces.hpp"

namespace espalier::dynamics {

/// Pressure p(t, q, v, lambda) on a set of faces, positive towards the solid.
class FacePressure final : public Component, public Switching, public ReadsMultipliers {
 public:
  FacePressure(std::string name, std::unique_ptr<PressedFaces> faces)
      : Component(std::move(name)), faces_(std::move(faces)) {}

  /// To be set before the system is finished.
  void set_pressure(StateFunctionPtr pressure) { pressure_ = ForceInputs({std::move(pressure)}); }
  /// A pressure that is switched off is zero; it keeps its place in the tangent.
  void set_active(bool active) { active_ = active; }
  [[nodiscard]] const PressedFaces& faces() const { return *faces_; }
  [[nodiscard]] const StateFunctionPtr& function() const { return pressure_.functions().front(); }
  /// On the function: that of the loads, zero where the pressure is switched off.
  [[nodiscard]] double factor() const { return active_ ? load_factor() : 0; }

  [[nodiscard]] Sizes sizes() const override { return {}; }
  void declare(PatternBuilder& w, PatternBuilder& phi_q) const override;
  void bind(const SparsePattern& w, const SparsePattern& phi_q) override;
  void residual(const StateView& s, Span f) override;
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;
  void declare_multipliers(PatternBuilder& f_lambda) const override;
  void bind_multipliers(const SparsePattern& f_lambda) override;
  void multiplier_tangent(const StateView& s, Span values) override;
  void branches(const StateView& s, Branches& out) const override {
    if (active_) function()->branches(s, out);
  }

 private:
  /// dF/dp at a configuration, one entry for each row of the faces.
  [[nodiscard]] std::vector<double> slope(ConstSpan q) const;

  std::unique_ptr<PressedFaces> faces_;
  ForceInputs pressure_;
  bool active_ = true;
};

/// The pressure that acts. @pre set_pressure() was called; `pressure` outlives the function
[[nodiscard]] StateFunctionPtr pressure_of(const FacePressure& pressure);

}  // namespace espalier::dynamics
