/// \file
/// The changed matrix as a sparse matrix of its own.
#pragma once

#include "changes/base.hpp"
#include "changes/changed_matrix.hpp"

namespace espalier::changes {

/// Whether all that is alive is symmetric.
bool symmetric(const ChangedMatrix& matrix, const Base& original);

/// Rows and columns by entities; those that are not alive are of the identity, times what is usual beside them. With
/// the pattern of A, in its storage, as long as nothing was added and the diagonal entries are there.
SparseMatrix folded(const ChangedMatrix& matrix, Base& original);

}  // namespace espalier::changes
