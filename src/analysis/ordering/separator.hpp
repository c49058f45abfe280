/// \file
/// Multilevel vertex separators.
#pragma once

#include <cstdint>

#include "analysis/ordering/coarsen.hpp"
#include "analysis/ordering/refine.hpp"

namespace espalier::analysis {

/// A small, balanced vertex separator of a connected graph, the same for the same graph and seed. Both sides are
/// non-empty wherever the graph is not complete. @param workers idle ones help
Separation find_separator(const PartGraph& graph, std::uint64_t seed, base::Recursion& workers);

}  // namespace espalier::analysis
