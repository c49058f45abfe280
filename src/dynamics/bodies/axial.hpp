/// \file
/// The vector of a matrix's antisymmetric part.
#pragma once

#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

/// u x phi of D = phi u^T, and of sums of such.
template <class Matrix>
[[nodiscard]] Vec3 axial(const Matrix& d) {
  return {d(2, 1) - d(1, 2), d(0, 2) - d(2, 0), d(1, 0) - d(0, 1)};
}

}  // namespace espalier::dynamics
