/// \file
/// The inverse of D of L D L^T, whose blocks are 1x1 and 2x2.
#pragma once

#include <span>
#include <vector>

#include "base/scalar.hpp"
#include "espalier/types.hpp"

namespace espalier::device {

/// x = D^-1 x.
/// @param d  rows; diagonal of D^-1
/// @param e  rows; its subdiagonal, nonzero at the first row of a 2x2 block
/// @param x  rows x columns, row by row
/// @param hermitian  what stands above the diagonal is the conjugate of e
template <class T>
void apply_inverse_d(const T* d, const T* e, Index rows, Index columns, T* x, bool hermitian = false) {
  for (Index k = 0; k < rows; ++k) {
    T* row = x + static_cast<Offset>(k) * columns;
    if (e[k] == T(0)) {
      for (Index c = 0; c < columns; ++c) row[c] *= d[k];
      continue;
    }
    const T above = hermitian ? base::conjugate(e[k]) : e[k];
    for (Index c = 0; c < columns; ++c) {
      const T y0 = row[c], y1 = row[columns + c];
      row[c] = d[k] * y0 + above * y1;
      row[columns + c] = e[k] * y0 + d[k + 1] * y1;
    }
    ++k;
  }
}

/// By row, whether it brings a negative eigenvalue of D; a 2x2 block has two rows.
template <class T>
std::vector<char> negative_of_inverse(std::span<const T> d, std::span<const T> e) {
  std::vector<char> negative(d.size());
  for (std::size_t k = 0; k < d.size(); ++k) {
    negative[k] = d[k] < T(0) ? 1 : 0;
    if (e[k] == T(0)) continue;
    // The block has one sign each where its determinant is negative, else both of its trace.
    const bool of_each = (d[k] / e[k]) * (d[k + 1] / e[k]) < T(1);
    if (of_each) negative[k] = 1;
    negative[k + 1] = of_each ? 0 : negative[k];
    ++k;
  }
  return negative;
}

}  // namespace espalier::device
