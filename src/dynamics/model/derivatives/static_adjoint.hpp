/// \file
/// Derivatives of an equilibrium by the adjoint method: one solve with the transposed stiffness for each quantity,
/// however many parameters there are.
#pragma once

#include <string>
#include <vector>

#include "dynamics/integrators/linearised.hpp"
#include "dynamics/model/derivatives/quantity_slopes.hpp"
#include "espalier/solver.hpp"

namespace espalier::dynamics::model {

/// At an equilibrium x = [q; lambda] the equations R(x, p) = [F + Phi_q^T lambda; Phi] are zero, so a quantity g(x, p)
/// has the derivative dg/dp = g_p - y^T R_p with K^T y = g_x and K = R_x (R. T. Haftka, Z. Guerdal, "Elements of
/// Structural Optimization", 1992, section 7.1). K is the tangent that statics uses; g_x comes from QuantitySlopes. R_p
/// and g_p are central differences of two models at the same x, made by the caller.
class StaticAdjoint {
 public:
  /// Factorizes K and solves for all quantities. @param mechanism, state  the equilibrium; they outlive the object
  /// @throws Error where K is singular
  StaticAdjoint(Mechanism& mechanism, Equations& equations, const State& state, const std::vector<Quantity>& quantities,
                double load, Options solver);

  /// R of another model of the same unknowns at this equilibrium, n + r numbers.
  [[nodiscard]] std::vector<double> residual(Mechanism& mechanism) const;
  /// Quantities of a model there. @param quantities  of that model
  [[nodiscard]] std::vector<double> values(const std::vector<Quantity>& quantities) const;
  /// y^T change, by quantity.
  [[nodiscard]] std::vector<double> along(const std::vector<double>& change) const;

  /// How far K is from the differences of R along K^-1 r, r random, over the largest of r: what derivatives may be
  /// wrong by, relatively, where a tangent is not exact.
  [[nodiscard]] double defect() const { return defect_; }

 private:
  [[nodiscard]] State moved(const std::vector<double>& step) const;
  [[nodiscard]] std::vector<double> gradient(const Quantity& quantity);
  void measure_defect(Solver& solver);

  Mechanism& mechanism_;
  const State& state_;
  std::vector<Index> rows_;  // constraints that are kept
  std::vector<char> dropped_;
  std::size_t n_ = 0;
  QuantitySlopes slopes_;
  std::vector<std::vector<double>> y_;  // of each quantity, n + r
  double defect_ = 0;
};

}  // namespace espalier::dynamics::model
