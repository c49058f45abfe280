/// \file
/// Factoring a diagonal tile and keeping what later tiles and the solve need of it.
#pragma once

#include <cmath>
#include <complex>

#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// det [a b; b c] / b, where b is the largest of the three.
template <class T>
T pair_over_coupling(T a, T b, T c) {
  return (a / b) * c - b;
}

/// The same of [a conj(b); b c] over |b|, for real a and c.
template <class T>
T hermitian_pair_over_coupling(T a, T b, T c) {
  const RealOf<T> size = std::abs(b);
  return (std::real(a) / size) * std::real(c) - size;
}

/// D^-1 of 1x1 and 2x2 blocks: diagonal d and subdiagonal e of D (n each; e[k] != 0 marks a block at k, k + 1) to those
/// of the inverse.
/// @param hermitian  what stands above the diagonal is the conjugate of e
template <class T>
void invert_blocks(Index n, const T* d, const T* e, T* d_inverse, T* e_inverse, bool hermitian = false) {
  for (Index k = 0; k < n; ++k) {
    if (k + 1 < n && e[k] != T(0)) {
      const T a = d[k], c = d[k + 1], b = hermitian ? T(std::abs(e[k])) : e[k];
      const T det_over_b = hermitian ? hermitian_pair_over_coupling(a, e[k], c) : pair_over_coupling(a, b, c);
      d_inverse[k] = c / b / det_over_b;
      d_inverse[k + 1] = a / b / det_over_b;
      e_inverse[k] = hermitian ? -e[k] / b / det_over_b : T(-1) / det_over_b;
      e_inverse[k + 1] = T(0);
      ++k;
    } else {
      d_inverse[k] = T(1) / d[k];
      e_inverse[k] = T(0);
    }
  }
}

/// What stands for a vanishing pivot: E of the factor of B + E, no other entry (solver/deficiency/deficiency.hpp).
template <class T>
ZeroPivot<RealOf<T>> zero_pivot(const PivotRule& rule) {
  return {static_cast<RealOf<T>>(rule.tiny),
          static_cast<RealOf<T>>(rule.in_place_of_zero > 0 ? rule.in_place_of_zero : rule.tiny)};
}

/// Pivots of a front that are eliminated together, in work.c.
struct PivotBlock {
  Index front;
  Index at;  ///< position of the first
  Index size;
  Offset ld;  ///< work.c is column-major
};

/// Factors the diagonal tile in work.c: writes the inverse(s) to `inverse` (and `inverse2` for lu), the pivot order,
/// D^-1, and the front's outcome.
template <class T>
void factor_diagonal(NumericState<T>& s, Workspace<T>& w, const PivotBlock& block, T* inverse, T* inverse2);

/// Books the results of pivoting. work.column holds d and e of ldlt (block.size each) on entry; for llt and lu the
/// diagonal of the factored tile is read.
/// @param replaced  block.size; null: none was
template <class T>
void book_pivots(NumericState<T>& s, Workspace<T>& w, const PivotBlock& block, const PivotCounts& counts,
                 const char* replaced);

/// The largest magnitudes of the columns of L in panels, over their first `rows` rows; at least what `growth` (cols)
/// holds. Rows of the border do not count: they are no row of the matrix that is factored.
template <class T>
void add_growth(const NumericState<T>& s, Index rows, Index cols, const T* panels, RealOf<T>* growth);

/// Marks the columns whose entries of L (max magnitude in `growth`, n values) exceed 1 / threshold; of those whose
/// pivot was replaced by PivotRule::in_place_of_zero, whose entries were no zeros.
template <class T>
void mark_growth(NumericState<T>& s, Index at, Index n, const RealOf<T>* growth);

/// lu: whether some of the pivots was replaced by PivotRule::in_place_of_zero; then mark_rows() wants to know of U.
template <class T>
bool has_parted(const NumericState<T>& s, Index at, Index n);
/// Marks such pivots of which the row that they took has entries of U (max magnitude in `growth`, n values) that are no
/// zeros: others may need it as pivot.
template <class T>
void mark_rows(NumericState<T>& s, Index at, Index n, const RealOf<T>* growth);

/// The same for the first `columns` columns of work.c. Of no effect for other kinds.
template <class T>
void mark_rows_inside(NumericState<T>& s, Workspace<T>& w, const PivotBlock& block, Index columns);

}  // namespace espalier::device::host
