/// \file
/// Is this a matrix? The check that every matrix from outside passes once.
#pragma once

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// Checks the arrays of a view: sizes, column pointers that begin at 0 and never fall, row indices inside the matrix
/// and inside the stored triangle, finite values. That symmetric_both holds equal triangles is not checked
/// (values_are_symmetric() does). Reads every entry once.
/// @throws Error(invalid_input) that names column and row, 0-based; Error::status().row is the row where there is one
void validate(const MatrixView& a, base::ThreadPool* pool = nullptr);
/// The same; both parts of a value must be finite, and the diagonal of a Hermitian matrix real.
void validate(const ComplexMatrixView& a, base::ThreadPool* pool = nullptr);

/// The pattern of a complex matrix, Hermitian storage as its symmetric counterpart.
MatrixView pattern_of(const ComplexMatrixView& a);

}  // namespace espalier::matrix
