/// \file
/// The parser of array files. Used by the readers in this folder only.
#pragma once

#include <vector>

#include "matrix/matrix_market_header.hpp"

namespace espalier::matrix {

/// The header.numbers() numbers of an array file in the order of the file: columns one after another, of a symmetric
/// matrix from the diagonal down, of a skew one from below the diagonal down. Several may stand in a line.
/// @throws Error(invalid_input) with the line
std::vector<double> parse_array_numbers(const Source& source, const MatrixMarketHeader& header,
                                        const ReadOptions& options);

/// body(i, j, k) for the place (i, j) of every k-th value of an array file.
template <class Body>
void for_each_packed(const MatrixMarketHeader& header, const Body& body) {
  Offset k = 0;
  for (Index j = 0; j < header.cols; ++j) {
    const Index top = header.symmetry == Symmetry::general ? 0 : header.symmetry == Symmetry::skew ? j + 1 : j;
    for (Index i = top; i < header.rows; ++i) body(i, j, k++);
  }
}

}  // namespace espalier::matrix
