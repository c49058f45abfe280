/// \file
/// Null vectors as the caller gets them, and the rows and columns that they name.
#pragma once

#include "solver/deficiency/deficiency.hpp"
#include "solver/deficiency/null_space_iteration.hpp"
#include "solver/deficiency/scaled_matrix.hpp"
#include "solver/deficiency/small_block.hpp"

namespace espalier::solver {

/// The description of found.by_pivots, the vectors alone.
/// @param null  basis of what B takes to nothing (of complex numbers: in the real space)
/// @param left  of lu: of B^T (complex: of B^H), else without columns
/// @pre found.zeros
void describe(const ScaledMatrix& b, const Block& null, const Block& left, Deficiency& found);

/// The same of vectors as they were made, which become a better basis, unless that takes too long: `work` operations.
/// Then the pivots name the rows.
void describe_all(const NullSpaceIteration& search, double work, Block null, Block left, Deficiency& found);

}  // namespace espalier::solver
