/// \file
/// `espalier solve --page`: the system, its order and tree, what it took, how exact it is.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sheet/sheet.hpp"
#include "solve/report.hpp"
#include "solve/spy.hpp"

namespace espalier::cli {

/// What a page shows beside the report; taken while the matrix and the solver are there.
struct SolvePictures {
  Spy given;
  std::optional<Spy> ordered;  ///< in the order of elimination
  std::vector<Solver::TierRow> tiers;
};

/// @param solver  analyzed; the order of real systems is taken from it
void take_order(SolvePictures& pictures, const MatrixView& pattern, Solver& solver);

/// @param report  of `record`  @param trace_file  where the timeline was written; empty: nowhere
[[nodiscard]] Sheet solve_sheet(const RunRecord& record, nlohmann::ordered_json report, const SolvePictures& pictures,
                                const std::string& trace_file);

}  // namespace espalier::cli
