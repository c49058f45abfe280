/// \file
/// A system given by functions (DaeFunctions): what stands behind espalier::Dae.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// Columns of a pattern in groups whose members have no common row: one difference serves a whole group (Curtis,
/// Powell, Reid 1974; greedy, in the order of the columns). `lines[k]` holds the rows of column k.
[[nodiscard]] std::vector<std::vector<Index>> independent_columns(const std::vector<std::vector<Index>>& lines,
                                                                  Index rows);

/// The system of equations of some functions.
class FunctionSystem final : public System {
 public:
  /// @throws std::invalid_argument for missing functions and for patterns beyond the matrix
  explicit FunctionSystem(DaeFunctions functions);

  [[nodiscard]] Sizes sizes() const override { return {f_.coordinates, f_.coordinates, f_.constraints}; }
  [[nodiscard]] std::string constraint_name(Index row) const override;
  void residual(const StateView& s, Span f) override;
  void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) override;
  [[nodiscard]] Energy energy(const StateView& s) override;
  [[nodiscard]] const SparsePattern& tangent_pattern() const override { return w_pattern_; }
  [[nodiscard]] const SparsePattern& constraint_pattern() const override { return phi_q_pattern_; }
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;

 private:
  using Groups = std::vector<std::vector<Index>>;
  [[nodiscard]] MatrixEntries tangent_entries(double* values) const;
  void phi_q(double t, ConstSpan q, Span values);
  void phi_q_by_differences(double t, ConstSpan q, Span values);
  void constraint_at(double t, ConstSpan q, std::vector<double>& phi) const;
  void gamma_by_differences(double t, ConstSpan q, ConstSpan v, Span gamma);
  void tangent_by_differences(const StateView& s, const TangentWeights& weights, Span w_values);
  void full_residual(const StateView& s, Span f);

  DaeFunctions f_;
  SparsePattern w_pattern_, phi_q_pattern_;
  Groups w_groups_, phi_q_groups_;                                               // of columns
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> phi_q_columns_;  // row and place of the entries
  std::vector<double> steps_;                   // of the differences of Phi, found once for each coordinate; 0: not yet
  std::array<std::vector<double>, 6> samples_;  // of Phi
  std::vector<double> mass_, phi_q_shifted_, shifted_;
};

}  // namespace espalier::dynamics
