/// \file
/// Stresses, strains, forces in sections and strain energies of the shapes of modes.
#pragma once

#include "dynamics/dae/system.hpp"
#include "dynamics/integrators/linearised.hpp"
#include "dynamics/model/answer/harmonic_observer.hpp"
#include "espalier/dynamics.hpp"

namespace espalier::dynamics::model {

/// The values of those of some quantities that have a value in a shape.
class ModeValues {
 public:
  /// @param load  load factor of a statics run
  ModeValues(Mechanism& mechanism, const State& state, const std::vector<Quantity>& quantities,
             std::optional<double> load);
  /// Displacement and values of the shape with a modal mass of 1; nothing where no quantity has a value.
  void add(const std::vector<double>& shape, SimulationMode& mode) const;

 private:
  [[nodiscard]] double energy(const Quantity& q, const std::vector<double>& shape, double step) const;

  Mechanism& mechanism_;
  const State& state_;
  std::optional<double> load_;
  std::vector<Quantity> fields_, energies_;
  Linearised linearised_;  // its mass, and its size
  std::unique_ptr<HarmonicObserver> observer_;
};

}  // namespace espalier::dynamics::model
