/// \file
/// The analysis of one system, repeated along the diagonal of a larger one.
#pragma once

#include "solver/analysis/analysis.hpp"
#include "solver/session/context.hpp"

namespace espalier::batch {

/// The analysis of the block-diagonal system with `copies` blocks of that pattern: order, scaling, matching and tiles
/// of each block are those of `one`.
/// @throws Error(out_of_memory)
solver::SharedAnalysis repeated_analysis(const solver::Analysis& one, Index copies, const solver::Context& context);

}  // namespace espalier::batch
