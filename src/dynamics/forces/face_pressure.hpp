/// \file
/// Pressure on faces of a solid as a function of the state.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/forces/force_inputs.hpp"

namespace espalier::dynamics {

/// Pressure p(t, q, v, lambda) on a set of faces, positive towards the solid. It is even over the faces, normal to them
/// and acts on their deformed area (a follower): F = p * integral of N_a (dx/dxi x dx/deta).
class FacePressure final : public Component {
 public:
  /// @param body of a system already @param mesh the one that the body was made of
  /// @throws std::invalid_argument unless the body is a solid; std::logic_error if the faces belong to another mesh
  FacePressure(std::string name, const FlexibleBody& body, const Mesh& mesh, std::span<const MeshFace> faces);

  /// To be set before the system is finished.
  void set_pressure(StateFunctionPtr pressure) { pressure_ = ForceInputs({std::move(pressure)}); }
  /// A pressure that is switched off is zero; it keeps its place in the tangent.
  void set_active(bool active) { active_ = active; }
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

 private:
  struct Face {
    ElementType type;
    std::vector<Index> rows;       ///< velocity coordinates, three for every node
    std::vector<Index> places;     ///< of the same numbers in the configuration
    std::vector<std::size_t> own;  ///< of the same in rows_
    std::vector<Offset> entries;   ///< of W, column by column
  };
  /// dF/dp at a configuration, one entry for each of rows_.
  [[nodiscard]] std::vector<double> slope(ConstSpan q) const;

  std::vector<Face> faces_;
  std::vector<Index> rows_;  // of all faces, each once
  ForceInputs pressure_;
  bool active_ = true;
};

/// The pressure that acts. @pre set_pressure() was called; `pressure` outlives the function
[[nodiscard]] StateFunctionPtr pressure_of(const FacePressure& pressure);

}  // namespace espalier::dynamics
