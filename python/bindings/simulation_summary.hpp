/// \file
/// The summary of a run as a dictionary.
#pragma once

#include <nanobind/nanobind.h>

#include "espalier/dynamics.hpp"

namespace espalier::python {

/// Nested, with the keys of summary.json (apps/espalier/simulate/simulate_report.cpp); what is no number stays NaN.
[[nodiscard]] nanobind::dict summary_dict(const SimulationSummary& s);

}  // namespace espalier::python
