/// \file
/// Frequency response of a model: the section [harmonic] of docs/guide/simulate.md.
#pragma once

#include <string>
#include <vector>

#include "espalier/dynamics.hpp"
#include "espalier/harmonic.hpp"

namespace espalier {

/// What a model answers to harmonic loads, about the state where it starts (with `[initial] statics` or `[statics]` its
/// equilibrium). In the units of the model.
struct ModelHarmonicResult {
  Status status;
  std::vector<std::string> quantities;  ///< names, the outputs of `response`
  std::vector<std::string> loads;       ///< names, the loads of `response`
  /// response.response(point, load, quantity): a complex amplitude y, so that the quantity changes by Re(y e^{i w t}).
  /// Shapes are increments of the velocity coordinates, then the multipliers of constraints that are not left out.
  HarmonicResult response;
  std::vector<std::string> notices;
};

/// The response of a model (a file, or its text with a name for messages) with a section [harmonic]. No motion is run;
/// the search of [statics] is. Of the options `set`, `out`, `quantities`, `solver`, `on_search` and `interrupted`
/// count.
///
/// The equations of motion are linearised where nothing moves: M x'' + D x' + K x = f with all of D and K (damping,
/// gyroscopic and circulatory terms, followers, forces as functions of the state), constraints by multipliers. Loads
/// and quantities are differences of the model's own equations and quantities, of fourth order.
///
/// Status invalid_input, beside what a simulation reports: there is no [harmonic]; it names loads or quantities that
/// are not there; the model moves where it is linearised; a quantity has a kink there. Else as harmonic_response():
/// what was found stands beside it.
ModelHarmonicResult model_harmonic(const std::string& path, const SimulationOptions& options = {});
ModelHarmonicResult model_harmonic_of_text(const std::string& text, const std::string& name,
                                           const SimulationOptions& options = {});

}  // namespace espalier
