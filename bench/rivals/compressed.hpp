/// \file
/// A rival's own copy of the matrix: sorted, summed, with a full diagonal, in the triangle and order that it wants.
#pragma once

#include <cstdint>
#include <vector>

#include "rivals/system_view.hpp"

namespace espalier::bench {

/// What a rival's arrays hold.
enum class Shape {
  lower_by_column,  ///< lower triangle, column by column
  upper_by_row,     ///< upper triangle, row by row: the same arrays, but for the signs of Hermitian imaginary parts
  full_by_column,   ///< all entries, CSC
  full_by_row,      ///< all entries, CSR
};

/// Compressed arrays made once per pattern from a system of any storage, and refilled from values in the view's
/// order. Indices within a column (row) ascend, duplicates are summed, every diagonal entry is present.
class CompressedMatrix {
 public:
  CompressedMatrix() = default;
  /// `base` (0 or 1) is added to pointers and indices. Fills the values if the view has any. The peak memory of the
  /// process is reset afterwards, so that the work arrays of the conversion do not count as the rival's.
  CompressedMatrix(const SystemView& a, Shape shape, int base);

  /// Sums values[k] of the view's entries into place; values.size() == parts * nonzeros of the view.
  void fill(std::span<const double> values);

  [[nodiscard]] Index size() const { return size_; }
  [[nodiscard]] Offset nonzeros() const { return static_cast<Offset>(indices.size()); }
  /// Bytes of the map from the view's entries.
  [[nodiscard]] Offset map_bytes() const;
  /// Pointers as 32-bit integers, which most rivals want. Throws Failure where they do not fit.
  [[nodiscard]] std::vector<std::int32_t> narrow_pointers() const;

  std::vector<Offset> pointers;       ///< size + 1 positions, plus base
  std::vector<std::int32_t> indices;  ///< nonzeros() row (or column) indices, plus base
  std::vector<double> values;         ///< nonzeros() values, of complex numbers real and imaginary parts in turn

 private:
  void convert(const MatrixView& a, Shape shape, int base);

  Index size_ = 0;
  std::size_t parts_ = 1;
  bool conjugate_ = false;         ///< entries stand where their transposes were, and are conjugated
  bool conjugate_mirror_ = false;  ///< mirror images are conjugates
  std::vector<Offset> slot_;  ///< per view entry: its place, or -1 where the shape leaves it out; empty: its own number
  std::vector<Offset> mirror_;  ///< per view entry: the place of its transpose, or -1; empty where there is none
};

}  // namespace espalier::bench
