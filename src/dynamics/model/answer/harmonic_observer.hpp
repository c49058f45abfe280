/// \file
/// Quantities of a model as linear functions of small harmonic motions.
#pragma once

#include <complex>
#include <functional>
#include <optional>
#include <vector>

#include "dynamics/integrators/linearised.hpp"
#include "dynamics/model/output/quantities.hpp"
#include "dynamics/model/output/scene.hpp"
#include "harmonic/observer.hpp"

namespace espalier::dynamics::model {

/// What a load changes: a number of the mechanism, by amplitude times cos(w t + phase).
struct DrivenNumber {
  double* number = nullptr;
  double step = 1;  ///< of differences by it
  std::complex<double> amplitude;
};

/// Derivatives along Re and Im of (dq, i w dq, -w^2 dq, dlambda): central differences of fourth order with steps of
/// 1e-5 of the extent of the model, separately by positions, by velocities and accelerations, and by multipliers; what
/// a load changes in a quantity without a motion is added.
class HarmonicObserver final : public harmonic::Observer {
 public:
  /// All outlive the object. @param multiplier  factor on the multipliers of a solution
  /// @param loads  as the columns of the loads  @param load  load factor of a statics run, for quantities
  HarmonicObserver(Mechanism& mechanism, const State& state, const Linearised& linearised,
                   std::vector<Quantity> quantities, const std::vector<std::vector<DrivenNumber>>& loads,
                   std::complex<double> multiplier, std::optional<double> load);
  /// What makes reactions that redundant constraints leave open those of least norm; none: they are as solved.
  void share_reactions(std::function<void(State&)> share) { share_ = std::move(share); }
  [[nodiscard]] Index outputs() const override { return static_cast<Index>(quantities_.size()); }
  void observe(double w, Index load, const harmonic::Complex* x, harmonic::Complex* y) override;
  [[nodiscard]] double noise(Index load, Index output) const override;

 private:
  struct Direction {
    std::vector<double> q, v, a, lambda;
  };
  /// Numbers of all quantities; those of fields are numbers at their sites, which are linear in the motion.
  using Numbers = std::vector<double>;
  [[nodiscard]] Numbers values(const State& s) const;
  /// Derivatives along a parameter h of states. @param step  of h
  template <class Place>
  Numbers derivative(double step, const Place& place) const;
  /// What the quantities make of them.
  void combine(const std::vector<harmonic::Complex>& numbers, harmonic::Complex* y) const;
  [[nodiscard]] Numbers along(const Direction& d) const;
  [[nodiscard]] double step_of(const std::vector<double>& dq) const;
  void measure_noise(double w, Index load, const harmonic::Complex* x);

  Mechanism& mechanism_;
  const State& state_;
  const Linearised& linearised_;
  std::vector<Quantity> quantities_;
  std::complex<double> multiplier_;
  std::optional<double> load_;
  std::function<void(State&)> share_;
  mutable Scene scene_;
  std::vector<std::size_t> first_;  // number of each quantity, and their count
  std::vector<std::size_t> owner_;  // quantity of each number
  Numbers here_;
  std::vector<std::vector<std::complex<double>>> direct_;  // of each load
  std::vector<Numbers> noise_;                             // of each load, by quantity
  std::vector<int> measured_;
};

}  // namespace espalier::dynamics::model
