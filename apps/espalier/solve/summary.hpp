/// \file
/// The summaries that people read.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "solve/report.hpp"

namespace espalier::cli {

/// Name, size and kind of the matrix in two lines.
std::string matrix_summary(const RunRecord& record);

/// The table of `espalier solve`: phases with time and rate, factor, memory, inertia, pivots, accuracy.
std::string solve_summary(const RunRecord& record);

/// The table of `espalier analyze`: phases, size of the factor, and the tree tier by tier.
std::string analysis_summary(const RunRecord& record, const std::vector<Solver::TierRow>& tiers);

/// What the factorization will take, and whether it fits `budget_bytes` (0: no limit is known).
/// @param disk  rates of the folder to which a part of the factor goes, if any
std::string forecast_summary(const AnalysisResult& analysis, Offset budget_bytes,
                             const std::optional<base::DiskRates>& disk);

}  // namespace espalier::cli
