/// \file
/// What is made of solutions: numbers that are linear in them.
#pragma once

#include <algorithm>
#include <span>

#include "harmonic/dynamic_stiffness.hpp"

namespace espalier::harmonic {

class Observer {
 public:
  virtual ~Observer() = default;
  /// Numbers that are made of one solution.
  [[nodiscard]] virtual Index outputs() const = 0;
  /// Writes them. Called by one thread at a time, in the order in which frequencies were asked for.
  /// @param w  angular frequency
  /// @param load  column of the loads that x answers to; -1: a motion without loads
  /// @param x  n numbers  @param y  outputs() numbers
  virtual void observe(double w, Index load, const Complex* x, Complex* y) = 0;
  /// Magnitude below which an output is rounding alone; 0: a small part of the largest output counts as that.
  [[nodiscard]] virtual double noise(Index /*load*/, Index /*output*/) const { return 0; }
};

/// Chosen unknowns, or all.
class UnknownObserver final : public Observer {
 public:
  /// @param unknowns  0-based, outlive the object; none: all n
  UnknownObserver(std::span<const Index> unknowns, Index n) : unknowns_(unknowns), n_(n) {}
  [[nodiscard]] Index outputs() const override { return unknowns_.empty() ? n_ : static_cast<Index>(unknowns_.size()); }
  void observe(double /*w*/, Index /*load*/, const Complex* x, Complex* y) override {
    if (unknowns_.empty()) std::copy(x, x + n_, y);
    for (std::size_t i = 0; i < unknowns_.size(); ++i) y[i] = x[unknowns_[i]];
  }

 private:
  std::span<const Index> unknowns_;
  Index n_;
};

}  // namespace espalier::harmonic
