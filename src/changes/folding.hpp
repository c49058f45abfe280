/// \file
/// The changed matrix as a sparse matrix of its own.
#pragma once

#include <type_traits>

#include "changes/base.hpp"
#include "changes/changed_matrix.hpp"

namespace espalier::changes {

template <class T>
using SparseMatrixOf = std::conditional_t<std::is_same_v<T, double>, SparseMatrix, ComplexSparseMatrix>;

/// Whether all that is alive is symmetric, or Hermitian where A is.
template <class T>
bool symmetric(const ChangedMatrix<T>& matrix, const Base<T>& original) {
  return original.symmetric() && matrix.items_are_symmetric();
}

/// Rows and columns by entities; those that are not alive are of the identity, times what is usual beside them. With
/// the pattern of A, in its storage, as long as nothing was added and the diagonal entries are there.
/// @param as_given  for a solver that knows what the caller's values are: Hermitian ones in general storage
template <class T>
SparseMatrixOf<T> folded(const ChangedMatrix<T>& matrix, Base<T>& original, bool as_given);

}  // namespace espalier::changes
