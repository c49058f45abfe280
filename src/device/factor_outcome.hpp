/// \file
/// What a numeric factorization is told about pivots, and what it came to.
#pragma once

#include <complex>
#include <span>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::device {

/// Pivoting inside a diagonal tile.
struct PivotRule {
  double threshold = 0.01;  ///< u: a pivot column with an entry of L above 1/u is reported as failed
  double tiny = 0;          ///< a pivot smaller in magnitude is replaced by +-tiny (absolute; matrix scaled to about 1)
  /// Above 0: a pivot below `tiny` is replaced by it instead (Limits::parts_with_zeros). Where its column (lu: its row,
  /// too) is as small, the unknown is parted from the others, whose factor stays as it would be without it.
  double in_place_of_zero = 0;
  double suspect = 0;  ///< ldlt, lu: a kept pivot below it (absolute) is reported as small; 0: none is
  double largest = 1;  ///< no entry of the matrix is larger in magnitude
  /// llt: by position; a positive pivot not above it is kept, but reported as replaced. Empty: none is.
  std::span<const double> smallest = {};
};

/// What one numeric factorization came to. Positions are those of the plan's elimination order.
struct FactorOutcome {
  Index not_positive = -1;  ///< llt: lowest position whose pivot was not positive (or NaN); -1: none
  Index negative = 0;       ///< negative eigenvalues of D (ldlt of real and Hermitian ones), replaced pivots left out
  Index two_by_two = 0;     ///< 2x2 pivots
  std::vector<Index> replaced;       ///< positions of pivots that were smaller than tiny, ascending
  std::vector<Index> replaced_rows;  ///< PivotRule::in_place_of_zero, lu: positions of the rows that they took
  /// Positions of pivots that were kept, but are below PivotRule::suspect, ascending.
  std::vector<Index> small;
  Index small_negative = 0;   ///< of them, how many `negative` counts (ldlt)
  std::vector<Index> failed;  ///< positions whose column of L exceeds 1/threshold, ascending
  /// Fronts above failed or replaced pivots, or in whose memory results of theirs are still needed, were not made:
  /// there is no factor (Executor::halt_at_failures()).
  bool halted = false;
  double determinant_sign = 1;                 ///< of the factored (scaled, permuted) matrix; complex: 0 for zero
  std::complex<double> determinant_phase = 1;  ///< complex: the determinant over its magnitude
  double determinant_log = 0;                  ///< natural logarithm of the magnitude
  double share = 1;         ///< of the operations for all fronts, those that were done (Executor::factorize_changed())
  double busy_seconds = 0;  ///< mean over workers of the time inside tasks
  double waiting_seconds = 0;  ///< mean over workers of the time inside tasks that wait for others
  double seconds = 0;          ///< wall time
};

}  // namespace espalier::device
