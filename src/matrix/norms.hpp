/// \file
/// Norms and symmetry of sparse matrices of any storage. Norms take the arrays entry by entry: where duplicates have
/// not been summed, they are upper bounds.
#pragma once

#include <complex>
#include <span>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// max_i sum_j |a_ij|; infinite when an entry is not finite. 0 for a matrix without rows.
double norm_inf(const MatrixView& a, base::ThreadPool* pool = nullptr);
/// max_j sum_i |a_ij|.
double norm_one(const MatrixView& a, base::ThreadPool* pool = nullptr);

/// Is (j, i) an entry wherever (i, j) is one? Explicit zeros are entries. Symmetric storage: true. Not square: false.
bool structure_is_symmetric(const MatrixView& a);

/// Is a_ij == a_ji for all entries, bit for bit (an absent entry equals an explicit zero; duplicates are summed first)?
/// lower and upper storage: true; both: checked. Not square, or without values: false (true for symmetric storage).
bool values_are_symmetric(const MatrixView& a);
/// The same of complex values in the pattern of `a`, whose own values are not read; `hermitian`: is a_ij the conjugate
/// of a_ji, and the diagonal real?
bool values_are_symmetric(const MatrixView& a, std::span<const std::complex<double>> values, bool hermitian);

}  // namespace espalier::matrix
