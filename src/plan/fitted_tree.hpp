/// \file
/// A tree whose fronts fill the arrays of a backend that pads them.
#pragma once

#include <vector>

#include "analysis/relocation.hpp"
#include "plan/plan.hpp"

namespace espalier::plan {

/// Which pivots to eliminate one front later, so that all factors together take less memory. Backends round pivots up
/// to whole chunks (16 columns): a front of 18 pivots takes the place of 32. The two that are too many go to the parent
/// where its last chunk has room for them, at the price of two rows more below. Front by front, children first; at most
/// half a chunk of each.
/// @pre options.arrays is given; tree.border == 0. Not for indefinite systems: pairs of unknowns that make one pivot
///      must not be parted
std::vector<analysis::PivotMove> moves_that_fit(const analysis::AssemblyTree& tree, const PlanOptions& options);

}  // namespace espalier::plan
