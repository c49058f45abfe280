/// \file
/// The pattern of a matrix, as a picture that is small.
#pragma once

#include <span>
#include <vector>

#include "espalier/matrix.hpp"

namespace espalier::cli {

struct Spy {
  int size = 0;                       ///< rows and columns of the picture: those of the matrix, at most kMostSpy
  std::vector<unsigned char> counts;  ///< size x size by rows: 0 without an entry, else 1 to 255, by their logarithm
  Offset entries = 0;                 ///< of the whole matrix, both triangles
};
constexpr int kMostSpy = 240;

/// @param a  values are not read  @param rows, columns  the place of each; empty: where it is
[[nodiscard]] Spy spy_of(const MatrixView& a, std::span<const Index> rows = {}, std::span<const Index> columns = {});

}  // namespace espalier::cli
