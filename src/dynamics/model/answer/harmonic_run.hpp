/// \file
/// The frequency response of a built model about a state.
#pragma once

#include <functional>
#include <optional>

#include "dynamics/model/output/quantities.hpp"
#include "espalier/model_harmonic.hpp"

namespace espalier::dynamics::model {

/// What the response is computed from; all outlive the call.
struct HarmonicCase {
  const HarmonicSpec& spec;
  Mechanism& mechanism;
  Equations& equations;
  const State& state;
  std::vector<Quantity> quantities;
  std::optional<double> load;  ///< load factor of a statics run
  bool equilibrium = false;    ///< the state is one, to the tolerance of the search for it
  const Options& solver;
  std::function<void(State&)> share;  ///< HarmonicObserver::share_reactions()
};

/// Failures after the first solve stand in the result's status, with what was found; else
/// @throws Error, with the place in the text where something there is wrong
[[nodiscard]] ModelHarmonicResult run_harmonic(const HarmonicCase& of);

/// One picture of a shape: Re(x e^{i phase}) at one of the phases of a period.
struct HarmonicPicture {
  double time = 0;            ///< number of the shape, from 1, and the part of the period
  std::vector<double> shift;  ///< increment of the configuration
  std::vector<double> v;      ///< its velocity
};
/// The pictures of one load, shape after shape. @param velocities  n of the model
[[nodiscard]] std::vector<HarmonicPicture> harmonic_pictures(const ModelHarmonicResult& r, std::size_t load, int phases,
                                                             Index velocities);

}  // namespace espalier::dynamics::model
