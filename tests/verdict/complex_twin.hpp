/// \file
/// Complex matrices that are as regular and definite as real ones.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <type_traits>

#include "verdict/sequence_truth.hpp"

namespace espalier::verdict {

/// P A P^T, or P A P^H where it is to be Hermitian, for a diagonal matrix P of numbers of magnitude 1; in doubles A
/// itself. Entry by entry: what is equal in two matrices is equal in their twins, and both triangles agree.
template <class T>
MatrixOf<T> twin_of(const SparseMatrix& a, bool hermitian) {
  if constexpr (std::is_same_v<T, double>) {
    return a;
  } else {
    ComplexSparseMatrix twin{a.rows, a.cols, a.col_ptr, a.row_ind, {}, a.storage};
    if (hermitian && a.storage == Storage::symmetric_lower) twin.storage = Storage::hermitian_lower;
    if (hermitian && a.storage == Storage::symmetric_upper) twin.storage = Storage::hermitian_upper;
    if (hermitian && a.storage == Storage::symmetric_both) twin.storage = Storage::hermitian_both;
    const auto p = [](Index i) { return std::polar(1.0, 2.4 * i); };
    for (Index c = 0; c < a.cols; ++c)
      for (auto q = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(c)]);
           q < static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(c) + 1]); ++q) {
        const Index r = a.row_ind[q], low = std::min(r, c), high = std::max(r, c);
        std::complex<double> turn = hermitian ? p(high) * std::conj(p(low)) : p(high) * p(low);
        if (hermitian) turn = r == c ? 1 : r < c ? std::conj(turn) : turn;
        twin.values.push_back(a.values[q] * turn);
      }
    return twin;
  }
}

}  // namespace espalier::verdict
