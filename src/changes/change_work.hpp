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

/// Operations of an H200 in a millisecond, sweeps and factorizations alike (elasticity 32^3).
inline constexpr double kDeviceMillisecond = 1.4e10;

template <class T>
bool on_device(const Base<T>& base) {
  return base.session().current().device.backend->limits().own_memory;
}

/// The work of a factorization, with what comes before. The entries of a device are made on the host, compared and
/// sent: 75 ms for 3.8 million.
template <class T>
double factorization_work(const Base<T>& base, bool same_pattern) {
  constexpr double kCall = 2e5, kEntry = 20, kAnalysis = 1000;  // of a call; an entry: copied, analyzed
  constexpr double kSentEntry = 20e-6 * kDeviceMillisecond;
  return base.session().analysis.flops + kCall +
         static_cast<double>(base.pattern().nonzeros()) *
             (kEntry + (same_pattern ? 0 : kAnalysis) + (on_device(base) ? kSentEntry : 0));
}

/// The work of products with `rows` columns of the border, for so many right-hand sides. A device waits for the few
/// numbers that go there and back.
template <class T>
double product_work(const Base<T>& base, std::size_t rows, Index columns) {
  constexpr double kProduct = 40;
  if (rows == 0) return 0;
  return kDoubles<T> * kProduct * static_cast<double>(rows) * static_cast<double>(base.order()) * columns +
         (on_device(base) ? 0.25 * kDeviceMillisecond : 0);
}

/// The work of the dense factor of the border's rows: of one thread, beside sweeps of all, or of a device.
template <class T>
double dense_work(const Base<T>& base, std::size_t rows) {
  const double weight = on_device(base) ? kDeviceMillisecond / 5e6 : 10;
  const auto k = static_cast<double>(rows);
  return kDoubles<T> * kDoubles<T> * weight * k * k * k * 2 / 3;
}

}  // namespace espalier::changes
