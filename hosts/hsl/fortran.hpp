/// \file
/// What the Fortran interfaces of MA27 and MA57 have in common: INFO, whose first word says how the call ended and
/// whose second one adds a number; and a matrix as coordinates.
#pragma once

#include <algorithm>
#include <climits>
#include <cstdint>

#include "common/border.hpp"
#include "common/inertia_solver.hpp"

namespace espalier::hosts {

constexpr int kInfoFlag = 0, kInfoDetail = 1;

/// Clears INFO and sets its flag to what `body` returns; `failed` stands for exceptions.
template <class Body>
void answer_in_info(int* info, int length, int failed, Body&& body) noexcept {
  if (info == nullptr) return;
  guarded(
      [&] {
        std::fill_n(info, length, 0);
        info[kInfoFlag] = body();
      },
      [&] { info[kInfoFlag] = failed; }, [&] { info[kInfoFlag] = failed; });
}

/// Sets the detail. @returns the flag
inline int fail(int* info, int flag, std::int64_t detail) {
  info[kInfoDetail] = static_cast<int>(std::clamp<std::int64_t>(detail, INT_MIN, INT_MAX));
  return flag;
}

/// Entries that lie outside of the matrix. @pre rows and columns hold `entries` numbers, from 1 on
inline int count_outside(int n, int entries, const int* rows, const int* columns) {
  int count = 0;
  for (int k = 0; k < entries; ++k)
    if (std::min(rows[k], columns[k]) < 1 || std::max(rows[k], columns[k]) > n) ++count;
  return count;
}

/// The host's threshold and bound of zeros, as far as they are ones.
inline void set_wish(double threshold, double zero_pivot, PivotWish& wish) {
  if (threshold > 0) wish.threshold = std::min(threshold, 0.5);
  if (zero_pivot > 0) wish.zero_pivot = std::min(zero_pivot, 1.0);
}

}  // namespace espalier::hosts
