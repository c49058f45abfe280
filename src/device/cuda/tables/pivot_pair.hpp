/// \file
/// Eigenvalues of a 2x2 pivot of L D L^T, on host and GPU.
#pragma once

#include <cmath>

#include "device/cuda/tables/tables.hpp"

namespace espalier::device::cuda {

struct PivotPair {
  double value[2];  ///< eigenvalues of the block of D; the first is the smaller in magnitude
};

/// @param a, b, c  the inverse of the block, [a b; b c], b != 0
ESPALIER_BOTH inline PivotPair pair_of_pivots(double a, double b, double c) {
  const double larger = (a + c) / 2 + std::copysign(std::hypot((a - c) / 2, b), a + c);
  return {{1 / larger, larger / (a * c - b * b)}};
}

}  // namespace espalier::device::cuda
