/// \file
/// Products with a sparse matrix of any storage.
#pragma once

#include <span>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// y = A x or y = A^T x for `columns` vectors stored one after another. x holds columns * (columns of op(A)) numbers, y
/// columns * (rows of op(A)); they must not overlap. Duplicates are summed, as everywhere.
/// Bit-identical for every number of threads: columns of A are cut into ranges of equal numbers of entries that depend
/// on A alone, each sums into a vector of its own, and the vectors are added in order. Memory: up to 7 such vectors.
/// @throws std::invalid_argument when a span has another length, or A has no values
void multiply(const MatrixView& a, Transpose transpose, std::span<const double> x, std::span<double> y,
              Index columns = 1, base::ThreadPool* pool = nullptr);

}  // namespace espalier::matrix
