/// \file
/// From one storage to another: transpose, expansion of a triangle, lower triangle, symmetric permutation.
#pragma once

#include <span>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// A^T in the same storage family: general stays general, lower becomes upper and the reverse (the arrays of the other
/// triangle). Rows within a column rise; repeated entries stay repeated. Values are absent where `a` has none.
SparseMatrix transpose(const MatrixView& a);

/// Every entry of `a`, as a general matrix: rows rising, duplicates summed. A general matrix is copied as it is.
SparseMatrix to_general(const MatrixView& a, base::ThreadPool* pool = nullptr);

/// The lower triangle of a symmetric matrix of any symmetric storage: rows rising, duplicates summed.
/// In symmetric_both the entries above the diagonal are left out, unread.
/// @throws std::invalid_argument when `a` is general
SparseMatrix to_lower(const MatrixView& a, base::ThreadPool* pool = nullptr);

/// L + sign L^T without the diagonal of L^T, for a lower triangle L with rows rising (sign -1: the skew matrix whose
/// lower triangle is L; its diagonal must be absent). Result general, rows rising.
SparseMatrix expand_lower(const MatrixView& lower, double sign);

/// B(k, l) = A(order[k], order[l]): row and column k of B are row and column order[k] of A. Symmetric storage gives
/// symmetric_lower, general gives general; rows rising, duplicates summed.
/// @param order permutation of 0..n-1 (old index of the k-th)
/// @throws std::invalid_argument when A is not square or `order` is not a permutation
SparseMatrix permute_symmetric(const MatrixView& a, std::span<const Index> order, base::ThreadPool* pool = nullptr);

/// The inverse permutation. @throws std::invalid_argument when `order` is not a permutation of 0..n-1
std::vector<Index> invert_permutation(std::span<const Index> order);

}  // namespace espalier::matrix
