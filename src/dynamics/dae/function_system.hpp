/// \file
/// A system given by functions: the quickest way to integrate one's own equations.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// A dense matrix to be filled in by the user, row by row; zero when the function is called.
class DenseView {
 public:
  DenseView(double* data, Index rows, Index cols) : data_(data), rows_(rows), cols_(cols) {}
  double& operator()(Index i, Index j) {
    return data_[static_cast<std::size_t>(i) * static_cast<std::size_t>(cols_) + static_cast<std::size_t>(j)];
  }
  [[nodiscard]] Index rows() const { return rows_; }
  [[nodiscard]] Index cols() const { return cols_; }

 private:
  double* data_;
  Index rows_, cols_;
};

/// The functions. What they write to is zero when they are called, except phi and gamma. Either `mass` and `force` (F =
/// M a - f) or `residual` must be given. Every derivative that is left empty is made by central differences; what is
/// given can be checked with check_jacobians().
struct SystemFunctions {
  Index velocity = 0;                                                               ///< n, also the size of q
  Index constraints = 0;                                                            ///< m
  std::function<void(ConstSpan q, DenseView m)> mass;                               ///< M(q), n x n
  std::function<void(double t, ConstSpan q, ConstSpan v, Span f)> force;            ///< f(t, q, v), n
  std::function<void(const StateView& s, Span f)> residual;                         ///< F, n
  std::function<void(double t, ConstSpan q, Span phi)> constraint;                  ///< Phi, m
  std::function<void(double t, ConstSpan q, DenseView phi_q)> constraint_jacobian;  ///< Phi_q, m x n
  std::function<void(double t, ConstSpan q, Span phi_t)>
      constraint_rate;  ///< dPhi/dt at fixed q; empty: Phi does not depend on t
  std::function<void(double t, ConstSpan q, ConstSpan v, Span gamma)> constraint_gamma;  ///< gamma
  std::function<void(const StateView& s, const TangentWeights& weights, DenseView w)>
      tangent;  ///< W (see System::tangent)
  std::function<Energy(const StateView& s)> energy;
  std::vector<std::string> constraint_names;  ///< empty, or one per constraint
};

/// Patterns are dense: for systems of up to some hundred unknowns. @throws std::invalid_argument for missing functions
class FunctionSystem final : public System {
 public:
  explicit FunctionSystem(SystemFunctions functions);

  [[nodiscard]] Sizes sizes() const override { return {f_.velocity, f_.velocity, f_.constraints}; }
  [[nodiscard]] std::string constraint_name(Index row) const override;
  void residual(const StateView& s, Span f) override;
  void constraints(double t, ConstSpan q, ConstSpan v, const ConstraintBuffers& out) override;
  [[nodiscard]] Energy energy(const StateView& s) override;
  [[nodiscard]] const SparsePattern& tangent_pattern() const override { return w_pattern_; }
  [[nodiscard]] const SparsePattern& constraint_pattern() const override { return phi_q_pattern_; }
  void tangent(const StateView& s, const TangentWeights& weights, Span w_values) override;

 private:
  void phi_q(double t, ConstSpan q, std::vector<double>& values);
  void gamma_by_differences(double t, ConstSpan q, ConstSpan v, Span gamma);
  void tangent_by_differences(const StateView& s, const TangentWeights& weights, Span w_values);
  void full_residual(const StateView& s, std::vector<double>& f);

  SystemFunctions f_;
  SparsePattern w_pattern_, phi_q_pattern_;
  std::vector<double> mass_, phi_q_, phi_q_shifted_, plus_, minus_, shifted_, w_rows_;
};

}  // namespace espalier::dynamics
