/// \file
/// Whether kept pivots would be judged otherwise by other limits.
#pragma once

#include <cmath>

#include "base/scalar.hpp"
#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// Pivots below so many times limits [0] may be small by other limits, too; kNearTiny is less.
inline constexpr int kFarFromTiny = 8;

/// Whether fronts whose pivots were judged by limits `was`, or by some close to them, would be the same by `now`.
/// @param same  all were judged by `was` itself
/// @param firm  none was replaced, or less than kFarFromTiny times was[0], and no search has passed a row so small that
/// another limit might have ended it (kNear)
template <class T>
bool judged_alike(Kind kind, const PivotLimits<T>& was, const PivotLimits<T>& now, bool same, bool firm) {
  if (now[1] != was[1]) return false;
  if (!base::keeps_fp64<T> && std::ilogb(now[3]) != std::ilogb(was[3])) return false;  // see HalfScales
  if (kind == Kind::llt || (same && now[0] == was[0])) return true;  // llt judges a pivot by its own entry
  constexpr int kRange = 2;
  return firm && now[0] <= kRange * was[0] && was[0] <= kRange * now[0];
}

}  // namespace espalier::device::cuda
