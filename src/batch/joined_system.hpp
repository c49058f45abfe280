/// \file
/// Systems beside each other on the diagonal of a larger one.
#pragma once

#include <span>

#include "solver/analysis/analysis_draft.hpp"
#include "solver/session/context.hpp"

namespace espalier::batch {

/// A system that is ordered, and the scaled values that it was ordered with.
struct JoinedBlock {
  const solver::Ordered* ordered = nullptr;
  double largest = 0;  ///< magnitude of the scaled values
};

/// The block-diagonal system of real systems of one kind and storage: order, scaling and matching of each block are
/// those of its system. Blocks are scaled by powers of four so that their largest entries are about 1: what counts as a
/// zero is measured by the largest entry of all.
/// @pre blocks are not empty, and their unknowns together are an Index
/// @throws Error(out_of_memory)
solver::Ordered joined_system(std::span<const JoinedBlock> blocks, const solver::Context& context);

}  // namespace espalier::batch
