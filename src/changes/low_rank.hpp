/// \file
/// A change of low rank as rows and columns.
#pragma once

#include <span>
#include <vector>

#include "changes/changed_matrix.hpp"

namespace espalier::changes {

/// Items of A + U C V^T over the unknowns of A, none for what changes nothing. Where that is symmetric (or Hermitian)
/// whatever A is, each of them is.
/// @param c  as many rows and columns as u and v have vectors; empty: the identity
/// @param hermitian  whether symmetric means that
/// @throws Error(invalid_input) where C is too large
template <class T>
std::vector<Item<T>> low_rank_items(const std::vector<SparseVector<T>>& u, std::span<const T> c,
                                    const std::vector<SparseVector<T>>& v, bool hermitian);

}  // namespace espalier::changes
