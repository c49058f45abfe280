/// \file
/// A run of the simulator as text for people and as JSON for programs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "espalier/dynamics.hpp"

namespace espalier::cli {

/// One line: sizes and degrees of freedom.
std::string simulate_headline(const SimulationSummary& s);
/// The summary as text.
std::string simulate_summary(const SimulationSummary& s);
/// The report; documented in docs/guide/simulate.md. @param model name of the model file
nlohmann::ordered_json to_json(const SimulationSummary& s, const std::string& model, int exit_code);

}  // namespace espalier::cli
