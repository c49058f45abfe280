/// \file
/// What linear statics gives, as numbers of any kind: each quantity to first order in the displacements.
#pragma once

#include <functional>
#include <vector>

#include "dynamics/dae/equations.hpp"

namespace espalier::dynamics::model {

/// g(x0) + g' for any function g of the state, with its derivative at x0 to the side of the solution x. So stresses and
/// reactions go with the loads, and those of which there is only a length (von Mises) as well; energies, which have no
/// first order where nothing is strained, with g'' / 2. Derivatives are those of a polynomial through x0 and four
/// points x0 (+) k h x, k = 1..4, at small steps of the same size whatever the loads are.
class LinearResponse {
 public:
  /// @param base x0, unloaded @param dq, lambda the solution at the load factor `load`
  /// @param stiff see linear_statics(): derivatives are taken with the load factors of its K
  LinearResponse(System& system, const State& base, std::vector<double> dq, const std::vector<double>& lambda,
                 double load, std::function<void()> stiff);

  using Vector = std::vector<double>;
  /// @param share of the loads
  [[nodiscard]] Vector of(const std::function<Vector(const State&)>& g, double share = 1) const;
  [[nodiscard]] double of(const std::function<double(const State&)>& g) const;
  /// g + g' + g'' / 2, under the loads throughout.
  [[nodiscard]] double energy(const std::function<double(const State&)>& g, double share = 1) const;
  /// The displaced configuration, as far as it can be one.
  [[nodiscard]] State displaced() const;
  /// Largest displacement relative to the extent of the model, or angle.
  [[nodiscard]] double size() const { return size_; }
  [[nodiscard]] double load() const { return load_; }

 private:
  System& system_;
  State base_;
  Vector dq_, lambda_;
  double load_, size_ = 0, step_ = 0;
  std::function<void()> stiff_;
  std::vector<State> points_;  // base, then four
};

}  // namespace espalier::dynamics::model
