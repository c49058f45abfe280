/// \file
/// One case checked and timed on the GPU, and what the plan alone would ask of it.
#pragma once

#include <nlohmann/json.hpp>

#include "gpu/check_settings.hpp"
#include "gpu/gpu_case.hpp"

namespace espalier::bench {

/// Factors, solves, repeats, and judges the answer by an independent residual; with settings.host beside the host
/// executor. Returns a row of the schema espalier-bench/1; what only this program knows stands in "check".
template <class T>
nlohmann::json check_case(const GpuCase& c, const CheckSettings& settings, base::ThreadPool& pool);

/// Whether a row of check_case() is as it must be: same bits in every run, backward errors below 1e3 units, the
/// host's inertia.
bool good(const nlohmann::json& row);

/// Prints what the plan would ask of each GPU, and the simulated time on H200s; returns a row with it. No GPU is
/// needed.
nlohmann::json show_plan(const GpuCase& c, const CheckSettings& settings);

}  // namespace espalier::bench
