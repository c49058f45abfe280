/// \file
/// What ChangeCost counts, in floating-point operations of doubles.
#pragma once

#include <cmath>

#include "changes/base.hpp"

namespace espalier::changes {

/// Columns, or right-hand sides, that go through the factor side by side.
inline constexpr Index kSideBySide = 32;
/// Doubles in a number.
template <class T>
inline constexpr double kDoubles = base::ScalarTraits<T>::is_complex ? 2 : 1;

/// The work of a sweep up and down the factor: it waits for memory.
template <class T>
double sweep_work(const Base<T>& base, Index columns) {
  constexpr double kEntry = 120, kColumn = 10;
  const auto entries = kDoubles<T> * static_cast<double>(base.session().analysis.nonzeros_factor);
  const double sweeps = std::ceil(static_cast<double>(columns) / kSideBySide);
  return entries * (kEntry * sweeps + kColumn * static_cast<double>(columns));
}

/// The work of a factorization, with what comes before.
template <class T>
double factorization_work(const Base<T>& base, bool same_pattern) {
  constexpr double kCall = 2e5, kEntry = 20, kAnalysis = 1000;  // of a call; an entry: copied, analyzed
  // The entries of a device are made on the host, compared and sent: 57 to 68 ms for 3.8 to 4.2 million entries beside
  // an H200, on which a millisecond of sweeps is 6e9 of these operations.
  constexpr double kSentEntry = 4e4;
  const bool sent = base.session().current().device.backend->limits().own_memory;
  return base.session().analysis.flops + kCall +
         static_cast<double>(base.pattern().nonzeros()) *
             (kEntry + (same_pattern ? 0 : kAnalysis) + (sent ? kSentEntry : 0));
}

/// The work of products with `rows` columns of the border, for so many right-hand sides.
template <class T>
double product_work(const Base<T>& base, std::size_t rows, Index columns) {
  constexpr double kProduct = 40;
  return kDoubles<T> * kProduct * static_cast<double>(rows) * static_cast<double>(base.order()) * columns;
}

}  // namespace espalier::changes
