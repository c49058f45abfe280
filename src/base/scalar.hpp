/// \file
/// What code that is written for several scalars asks about one of them. Bytes do not tell: complex<float> is as wide
/// as double.
#pragma once

#include <complex>
#include <limits>
#include <type_traits>

#include "espalier/types.hpp"

namespace espalier::base {

template <class T>
struct ScalarTraits {
  static_assert(std::is_same_v<T, float> || std::is_same_v<T, double>);
  using Real = T;
  static constexpr bool is_complex = false;
  /// In which numbers are stored: fp64 or fp32.
  static constexpr Precision precision = std::is_same_v<T, double> ? Precision::fp64 : Precision::fp32;
  static constexpr double epsilon = std::numeric_limits<T>::epsilon();
};

/// Precision and epsilon are those of the real and the imaginary part.
template <class T>
struct ScalarTraits<std::complex<T>> : ScalarTraits<T> {
  static constexpr bool is_complex = true;
};

/// Whether no digit of the caller's values is lost where they are stored as T.
template <class T>
inline constexpr bool keeps_fp64 = ScalarTraits<T>::precision == Precision::fp64;

}  // namespace espalier::base
