/// \file
/// Solutions of a singular system by a factor of B + E, where E stands for more pivots than there are zeros.
#pragma once

#include <span>
#include <vector>

#include "solve/residual.hpp"
#include "solver/deficiency/small_block.hpp"

namespace espalier::solver {

/// What (op(A) + E)^-1 b lacks of a solution: its residual stands in the rows of E alone, in the range of what op(A)
/// makes of (op(A) + E)^-1 E, which has few dimensions. x += to from^T (b - op(A) x) there, the Woodbury formula on
/// this range.
struct RankCorrection {
  std::vector<Index> places;  ///< rows of E, counted in real numbers
  Block from{0, 0};           ///< places x dimensions
  Block to{0, 0};             ///< n x dimensions

  /// @param b, x  `columns` vectors; x = (op(A) + E)^-1 b on entry, a solution on return where b has one
  void add(const solve::ResidualSpace& a, const double* b, double* x, Index columns, bool transpose) const;
};

}  // namespace espalier::solver
