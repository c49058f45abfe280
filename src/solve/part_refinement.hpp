/// \file
/// Refinement of many systems at once that are parts of one block-diagonal matrix, each judged for itself.
#pragma once

#include <span>

#include "solve/refinement.hpp"

namespace espalier::solve {

/// What refine() does, without Krylov methods, with the right-hand sides of each part: they take those corrections that
/// make them better, and no more once they stall. A step is one call of `m`, for all of them.
/// @param systems  of the whole, in the memory of `a`; x: copies may be under way on return
/// @param results  columns x parts: of all parts of one column after another
void refine_parts(const device::PartSpace& a, const Preconditioner& m, const Systems& systems,
                  const RefinementOptions& options, std::span<RefinementResult> results);

}  // namespace espalier::solve
