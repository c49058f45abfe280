/// \file
/// The matrices of the C interface as the solver wants them: columns, 0-based, 32-bit rows and 64-bit positions.
#pragma once

#include <vector>

#include "espalier/espalier.h"
#include "espalier/matrix.hpp"

namespace espalier::solver {

/// A view of a caller's matrix together with the arrays that had to be converted for it; the values, and 0-based 32-bit
/// indices, stay the caller's.
class CMatrix {
 public:
  /// @param values_needed false: absent values make a pattern; true: they are an error
  /// @throws std::invalid_argument for null arrays and unknown enumerators
  /// @throws Error(invalid_input) for pointers or indices that do not describe a matrix
  template <class Matrix>
  CMatrix(const Matrix& a, bool values_needed);

  /// The view of a complex matrix without values.
  [[nodiscard]] const MatrixView& view() const { return view_; }
  [[nodiscard]] bool complex() const { return complex_; }
  /// @pre complex()
  [[nodiscard]] const ComplexMatrixView& complex_view() const { return complex_view_; }
  /// True when the view is A^T: a general matrix given by rows. Its values keep their order, so that nothing is
  /// moved at a refactorization; whoever solves transposes once more.
  [[nodiscard]] bool transposed() const { return transposed_; }
  /// The view's columns are the caller's rows: messages about the one are to be told of the other.
  [[nodiscard]] bool by_rows() const { return by_rows_; }

 private:
  std::vector<Offset> pointers_;
  std::vector<Index> indices_;
  MatrixView view_;
  ComplexMatrixView complex_view_;
  bool complex_ = false;
  bool transposed_ = false;
  bool by_rows_ = false;
};

}  // namespace espalier::solver
