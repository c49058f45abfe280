/// \file
/// Factoring a diagonal tile and keeping what later tiles and the solve need of it.
#pragma once

#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// Factors the n x n diagonal tile in work.c (column-major, ld) whose first pivot stands at position `at` of front f:
/// writes the inverse(s) to `inverse` (and `inverse2` for lu), the pivot order, D^-1, and the front's outcome.
template <class T>
void factor_diagonal(NumericState<T>& s, Workspace<T>& w, Index f, Index at, Index n, Offset ld, T* inverse,
                     T* inverse2);

/// Books the results of pivoting n columns from position `at` on. work.column holds d and e of ldlt (n each) on entry.
/// @param c, ld  the factored tile; its diagonal is read for llt and lu
template <class T>
void book_pivots(NumericState<T>& s, Workspace<T>& w, Index f, Index at, Index n, const T* c, Offset ld,
                 const PivotCounts& counts, const char* replaced);

/// Marks the columns whose entries of L (max magnitude in `growth`, n values) exceed 1 / threshold.
template <class T>
void mark_growth(NumericState<T>& s, Index at, Index n, const T* growth);

}  // namespace espalier::device::host
