/// \file
/// The summary of a run for its page.
#pragma once

#include <string>

#include "espalier/dynamics.hpp"

namespace espalier::dynamics::page {

[[nodiscard]] std::string summary_json(const SimulationSummary& s, const Status& status);

}  // namespace espalier::dynamics::page
