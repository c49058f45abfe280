/// \file
/// Sparse matrices in compressed sparse column (CSC) form: a view that owns nothing and a matrix that owns its arrays.
#pragma once

#include <complex>
#include <span>
#include <vector>

#include "espalier/types.hpp"

namespace espalier {

/// A sparse matrix in CSC form that somebody else owns. Indices are 0-based. Rows within a column may stand in any
/// order and may repeat (duplicates are summed). The arrays must outlive every call that takes the view.
struct MatrixView {
  Index rows = 0;                      ///< number of rows
  Index cols = 0;                      ///< number of columns
  std::span<const Offset> col_ptr;     ///< cols + 1 positions into row_ind and values; col_ptr[0] == 0
  std::span<const Index> row_ind;      ///< col_ptr[cols] row indices
  std::span<const double> values;      ///< col_ptr[cols] values; empty for a pattern
  Storage storage = Storage::general;  ///< which entries are stored

  [[nodiscard]] Offset nonzeros() const { return col_ptr.empty() ? 0 : col_ptr.back(); }
  [[nodiscard]] bool symmetric() const { return storage != Storage::general; }
};

/// A sparse matrix in CSC form that owns its arrays; same conventions as MatrixView.
struct SparseMatrix {
  Index rows = 0;
  Index cols = 0;
  std::vector<Offset> col_ptr;
  std::vector<Index> row_ind;
  std::vector<double> values;
  Storage storage = Storage::general;

  [[nodiscard]] Offset nonzeros() const { return col_ptr.empty() ? 0 : col_ptr.back(); }
  [[nodiscard]] bool symmetric() const { return storage != Storage::general; }
  [[nodiscard]] MatrixView view() const { return {rows, cols, col_ptr, row_ind, values, storage}; }
  operator MatrixView() const { return view(); }  // NOLINT(google-explicit-constructor): an owner is a view
};

/// The same for a complex matrix, whose storage may be Hermitian as well. The diagonal of a Hermitian one is real.
struct ComplexMatrixView {
  Index rows = 0;
  Index cols = 0;
  std::span<const Offset> col_ptr;               ///< cols + 1
  std::span<const Index> row_ind;                ///< col_ptr[cols]
  std::span<const std::complex<double>> values;  ///< col_ptr[cols]; empty for a pattern
  Storage storage = Storage::general;

  [[nodiscard]] Offset nonzeros() const { return col_ptr.empty() ? 0 : col_ptr.back(); }
  [[nodiscard]] bool hermitian() const { return storage >= Storage::hermitian_lower; }
};

/// A complex sparse matrix that owns its arrays.
struct ComplexSparseMatrix {
  Index rows = 0;
  Index cols = 0;
  std::vector<Offset> col_ptr;
  std::vector<Index> row_ind;
  std::vector<std::complex<double>> values;
  Storage storage = Storage::general;

  [[nodiscard]] Offset nonzeros() const { return col_ptr.empty() ? 0 : col_ptr.back(); }
  [[nodiscard]] ComplexMatrixView view() const { return {rows, cols, col_ptr, row_ind, values, storage}; }
  operator ComplexMatrixView() const { return view(); }  // NOLINT(google-explicit-constructor): an owner is a view
};

}  // namespace espalier
