/// \file
/// What a force depends on beside the motion of its own frames: numbers of the state, and their place in the tangent.
#pragma once

#include "dynamics/forces/state_function.hpp"

namespace espalier::dynamics {

/// The inputs u_k(t, q, v, lambda) of one force F(.., u). The force gives dF/du_k in its own coordinates; here the
/// chain rule adds dF/du_k (du_k/dx)^T to W and to F_lambda.
class ForceInputs {
 public:
  ForceInputs() = default;
  explicit ForceInputs(std::vector<StateFunctionPtr> inputs) : inputs_(std::move(inputs)) {}

  [[nodiscard]] bool empty() const { return inputs_.empty(); }
  [[nodiscard]] std::size_t size() const { return inputs_.size(); }
  [[nodiscard]] const std::vector<StateFunctionPtr>& functions() const { return inputs_; }
  [[nodiscard]] std::vector<double> values(const StateView& s) const;

  /// @param rows coordinates of the force; negative ones are skipped
  void declare(std::span<const Index> rows, PatternBuilder& w) const;
  void declare_multipliers(std::span<const Index> rows, PatternBuilder& f_lambda) const;
  void bind(std::span<const Index> rows, const SparsePattern& w);
  void bind_multipliers(std::span<const Index> rows, const SparsePattern& f_lambda);
  /// W += weight * slope (du_k/dx)^T. @param slope dF/du_k, one entry per row
  void add_tangent(const StateView& s, std::size_t k, ConstSpan slope, const TangentWeights& weights,
                   Span w_values) const;
  void add_multiplier_tangent(const StateView& s, std::size_t k, ConstSpan slope, Span values) const;

 private:
  std::vector<StateFunctionPtr> inputs_;
  // Positions of the entries (row by row within a column); -1: a row that is skipped.
  std::vector<std::vector<Offset>> w_position_, lambda_position_;
};

}  // namespace espalier::dynamics
