/// \file
/// Numbers that are functions of the state, with exact derivatives: what forces, expressions, events and outputs are
/// made of.
#pragma once

#include <memory>
#include <vector>

#include "dynamics/dae/switching.hpp"

namespace espalier::dynamics {

/// Derivatives of one number. `q` (increments) and `v` have one entry for every coordinate of the function, `lambda`
/// one for every multiplier.
struct StateGradient {
  std::vector<double> q, v, lambda;
};

/// A number y(t, q, v, lambda). It depends on a fixed list of velocity coordinates (through q or v) and of multipliers.
class StateFunction {
 public:
  virtual ~StateFunction() = default;
  /// Global indices of velocity coordinates, in any order; an index may stand more than once (its derivatives add up).
  [[nodiscard]] const std::vector<Index>& coordinates() const { return coordinates_; }
  /// Global indices of constraint equations, likewise.
  [[nodiscard]] const std::vector<Index>& multipliers() const { return multipliers_; }
  /// @throws espalier::Error where the function has no finite value
  [[nodiscard]] virtual double value(const StateView& s) const = 0;
  /// Derivatives at a state; sets the sizes of `out` and overwrites it.
  void gradient(const StateView& s, StateGradient& out) const;
  /// Where it has corners or jumps, see Branch.
  virtual void branches(const StateView& /*s*/, Branches& /*out*/) const {}

 protected:
  /// Adds the derivatives to `out`, which has its sizes.
  virtual void add_gradient(const StateView& s, StateGradient& out) const = 0;

  std::vector<Index> coordinates_, multipliers_;
};

using StateFunctionPtr = std::shared_ptr<const StateFunction>;

/// A number made of others by the chain rule: the lists of all of them together, each index once.
class CompositeFunction : public StateFunction {
 public:
  explicit CompositeFunction(std::vector<StateFunctionPtr> parts);
  /// The branches of its parts.
  void branches(const StateView& s, Branches& out) const override;

 protected:
  [[nodiscard]] const std::vector<StateFunctionPtr>& parts() const { return parts_; }
  /// out += factor * gradient of part k
  void add_part(const StateView& s, std::size_t k, double factor, StateGradient& out) const;

 private:
  std::vector<StateFunctionPtr> parts_;
  std::vector<std::vector<std::size_t>> coordinate_place_, multiplier_place_;  // of the entries of every part
};

}  // namespace espalier::dynamics
