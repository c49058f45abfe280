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

template <class T>
using RealOf = typename ScalarTraits<T>::Real;
/// The same in FP64.
template <class T>
using WideOf = std::conditional_t<ScalarTraits<T>::is_complex, std::complex<double>, double>;

template <class T>
constexpr T conjugate(T x) {
  if constexpr (ScalarTraits<T>::is_complex) {
    return {x.real(), -x.imag()};
  } else {
    return x;
  }
}

/// x as `To`, which may have fewer digits.
template <class To, class From>
constexpr To narrowed(From x) {
  if constexpr (ScalarTraits<To>::is_complex) {
    return {static_cast<RealOf<To>>(x.real()), static_cast<RealOf<To>>(x.imag())};
  } else {
    return static_cast<To>(x);
  }
}

/// What the values of a linear system are. Where code serves all of them, arrays of complex numbers are passed as those
/// of doubles, real and imaginary parts in turn (as std::complex lies in memory, [complex.numbers.general]).
enum class Numbers {
  real,
  complex,    ///< symmetric where the matrix is
  hermitian,  ///< complex: what is called symmetric is Hermitian
};
/// Doubles in one number.
constexpr Index parts_of(Numbers n) { return n == Numbers::real ? 1 : 2; }
inline const std::complex<double>* as_complex(const double* p) {
  return reinterpret_cast<const std::complex<double>*>(p);
}
inline std::complex<double>* as_complex(double* p) { return reinterpret_cast<std::complex<double>*>(p); }
/// Calls use(p) with a pointer to numbers of their own type.
template <class Use>
decltype(auto) with_numbers(Numbers n, const double* p, Use&& use) {
  return n == Numbers::real ? use(p) : use(as_complex(p));
}

}  // namespace espalier::base

/// Applies a macro to each scalar in which factors are kept: for explicit instantiations.
#define ESPALIER_FOR_SCALARS(apply) apply(double) apply(float) apply(std::complex<double>) apply(std::complex<float>)
