/// \file
/// Vectors of real or complex numbers. `vn` has Highway's operations under their own names for both; a complex vector
/// holds real and imaginary parts in turn, as std::complex lies in memory. Compiled once per instruction set, hence the
/// include guard that toggles.
#if defined(ESPALIER_DEVICE_HOST_VECTOR_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef ESPALIER_DEVICE_HOST_VECTOR_INL
#undef ESPALIER_DEVICE_HOST_VECTOR_INL
#else
#define ESPALIER_DEVICE_HOST_VECTOR_INL
#endif

#include <cmath>
#include <complex>
#include <cstdint>

#include "base/scalar.hpp"
#include "device/host/kernels/kernels.hpp"
#include "hwy/highway.h"
#if HWY_TARGET == HWY_SCALAR
#include "device/host/kernels/pair_vector-inl.hpp"
#endif

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class T>
using Real = typename base::ScalarTraits<T>::Real;
template <class T>
inline constexpr bool kComplex = base::ScalarTraits<T>::is_complex;
/// Real numbers in one element.
template <class T>
inline constexpr int kParts = kComplex<T> ? 2 : 1;

namespace vn {
using hn::Abs;
using hn::Add;
using hn::And;
using hn::DupEven;
using hn::Eq;
using hn::FindFirstTrue;
using hn::FirstN;
using hn::Floor;
using hn::Ge;
using hn::GetLane;
using hn::Gt;
using hn::IfThenElse;
using hn::IfThenElseZero;
using hn::Iota;
using hn::LoadU;
using hn::Lt;
using hn::Max;
using hn::MaxOfLanes;
using hn::Mul;
using hn::MulAdd;
using hn::MulSub;
using hn::Ne;
using hn::Neg;
using hn::NegMulAdd;
using hn::OddEven;
using hn::Reverse2;
using hn::Set;
using hn::StoreU;
using hn::Sub;
using hn::SumOfLanes;
using hn::Zero;
#if HWY_TARGET == HWY_SCALAR
using pairs::Abs;
using pairs::Add;
using pairs::And;
using pairs::DupEven;
using pairs::DupOdd;
using pairs::Eq;
using pairs::FindFirstTrue;
using pairs::FirstN;
using pairs::Floor;
using pairs::Ge;
using pairs::GetLane;
using pairs::Gt;
using pairs::IfThenElse;
using pairs::IfThenElseZero;
using pairs::Iota;
using pairs::LoadU;
using pairs::Lt;
using pairs::Max;
using pairs::MaxOfLanes;
using pairs::Mul;
using pairs::MulAdd;
using pairs::MulSub;
using pairs::Ne;
using pairs::Neg;
using pairs::NegMulAdd;
using pairs::OddEven;
using pairs::Reverse2;
using pairs::Set;
using pairs::StoreU;
using pairs::Sub;
using pairs::SumOfLanes;
using pairs::Zero;
#else
using hn::DupOdd;
#endif
}  // namespace vn

/// Vectors of the parts of numbers.
template <class T>
struct RealTypes {
  using Tag = hn::ScalableTag<Real<T>>;
  using Vector = hn::Vec<Tag>;
  static constexpr int kLanes = static_cast<int>(hn::MaxLanes(Tag()));
};
#if HWY_TARGET == HWY_SCALAR
template <class R>
struct RealTypes<std::complex<R>> {
  using Tag = pairs::PairTag<R>;
  using Vector = pairs::PairVector<R>;
  static constexpr int kLanes = 2;
};
#endif
template <class T>
using RealTag = typename RealTypes<T>::Tag;
template <class T>
using RealVector = typename RealTypes<T>::Vector;

template <class T>
struct ComplexTag {};
template <class T>
struct ComplexVector {
  RealVector<T> v;
};

template <class T>
struct VectorTypes {
  using Tag = hn::ScalableTag<T>;
  using Vector = hn::Vec<Tag>;
};
template <class R>
struct VectorTypes<std::complex<R>> {
  using Tag = ComplexTag<std::complex<R>>;
  using Vector = ComplexVector<std::complex<R>>;
};
template <class T>
using Tag = typename VectorTypes<T>::Tag;
template <class T>
using Vector = typename VectorTypes<T>::Vector;

/// Elements of a vector and vectors of a panel (1 with 64-byte registers).
template <class T>
inline constexpr int kLanes = RealTypes<T>::kLanes / kParts<T>;
template <class T>
inline constexpr int kVectors = kPanel<T> / kLanes<T>;

/// i x.
template <class T>
HWY_INLINE ComplexVector<T> times_i(ComplexVector<T> x) {
  const RealVector<T> turned = vn::Reverse2(RealTag<T>(), x.v);
  return {vn::OddEven(turned, vn::Neg(turned))};
}

namespace vn {  // masks are those of real numbers. NOLINTBEGIN(readability-identifier-naming): Highway's names
template <class T>
HWY_INLINE ComplexVector<T> LoadU(ComplexTag<T> /*tag*/, const T* p) {
  return {vn::LoadU(RealTag<T>(), reinterpret_cast<const Real<T>*>(p))};
}
template <class T>
HWY_INLINE void StoreU(ComplexVector<T> x, ComplexTag<T> /*tag*/, T* p) {
  vn::StoreU(x.v, RealTag<T>(), reinterpret_cast<Real<T>*>(p));
}
template <class T>
HWY_INLINE ComplexVector<T> Zero(ComplexTag<T> /*tag*/) {
  return {vn::Zero(RealTag<T>())};
}
template <class T>
HWY_INLINE ComplexVector<T> Set(ComplexTag<T> /*tag*/, T value) {
  const RealTag<T> tag;
  return {vn::OddEven(vn::Set(tag, value.imag()), vn::Set(tag, value.real()))};
}
template <class T>
HWY_INLINE ComplexVector<T> Add(ComplexVector<T> x, ComplexVector<T> y) {
  return {vn::Add(x.v, y.v)};
}
template <class T>
HWY_INLINE ComplexVector<T> Sub(ComplexVector<T> x, ComplexVector<T> y) {
  return {vn::Sub(x.v, y.v)};
}
template <class T>
HWY_INLINE ComplexVector<T> Mul(ComplexVector<T> x, ComplexVector<T> y) {
  return {vn::MulAdd(times_i(x).v, vn::DupOdd(y.v), vn::Mul(x.v, vn::DupEven(y.v)))};
}
template <class T>
HWY_INLINE ComplexVector<T> MulAdd(ComplexVector<T> x, ComplexVector<T> y, ComplexVector<T> z) {
  return {vn::MulAdd(times_i(x).v, vn::DupOdd(y.v), vn::MulAdd(x.v, vn::DupEven(y.v), z.v))};
}
template <class T>
HWY_INLINE ComplexVector<T> MulSub(ComplexVector<T> x, ComplexVector<T> y, ComplexVector<T> z) {
  return {vn::MulAdd(times_i(x).v, vn::DupOdd(y.v), vn::MulSub(x.v, vn::DupEven(y.v), z.v))};
}
template <class T>
HWY_INLINE ComplexVector<T> NegMulAdd(ComplexVector<T> x, ComplexVector<T> y, ComplexVector<T> z) {
  return {vn::NegMulAdd(times_i(x).v, vn::DupOdd(y.v), vn::NegMulAdd(x.v, vn::DupEven(y.v), z.v))};
}
template <class Mask, class T>
HWY_INLINE ComplexVector<T> IfThenElse(Mask mask, ComplexVector<T> yes, ComplexVector<T> no) {
  return {vn::IfThenElse(mask, yes.v, no.v)};
}
template <class Mask, class T>
HWY_INLINE ComplexVector<T> IfThenElseZero(Mask mask, ComplexVector<T> yes) {
  return {vn::IfThenElseZero(mask, yes.v)};
}
// NOLINTEND(readability-identifier-naming)
}  // namespace vn

/// The number of each element, counted from `first`, in the place of each of its parts.
template <class T>
HWY_INLINE RealVector<T> element_numbers(std::int64_t first) {
  const RealTag<T> tag;
  if constexpr (kComplex<T>) {
    const RealVector<T> part = vn::Iota(tag, Real<T>(0));
    return vn::Add(vn::Floor(vn::Mul(part, vn::Set(tag, Real<T>(0.5)))), vn::Set(tag, static_cast<Real<T>>(first)));
  } else {
    return vn::Iota(tag, static_cast<T>(first));
  }
}
/// The first `elements` of a vector.
template <class T>
HWY_INLINE auto first_elements(std::int64_t elements) {
  return vn::FirstN(RealTag<T>(), static_cast<std::size_t>(elements * kParts<T>));
}

/// |x|; of complex numbers |re x| + |im x|, in the place of both parts.
template <class T>
HWY_INLINE RealVector<T> magnitude_of(Vector<T> x) {
  if constexpr (kComplex<T>) {
    const RealVector<T> parts = vn::Abs(x.v);
    return vn::Add(parts, vn::Reverse2(RealTag<T>(), parts));
  } else {
    return vn::Abs(x);
  }
}
template <class T>
Real<T> magnitude_of(T x) {
  if constexpr (kComplex<T>) {
    return std::abs(x.real()) + std::abs(x.imag());
  } else {
    return std::abs(x);
  }
}
template <class T>
Real<T> real_of(T x) {
  if constexpr (kComplex<T>) {
    return x.real();
  } else {
    return x;
  }
}
/// The conjugate, where it is asked for.
template <bool kConjugate, class T>
HWY_INLINE T conjugate(T x) {
  if constexpr (kConjugate && kComplex<T>) {
    return {x.real(), -x.imag()};
  } else {
    return x;
  }
}
/// What takes the place of a pivot that is too small.
template <class T>
T replacement(Real<T> size, T pivot) {
  if constexpr (kComplex<T>) {
    return T(std::copysign(size, pivot.real()));
  } else {
    return std::copysign(size, pivot);
  }
}
template <class T>
T sum_of(Vector<T> x) {
  const RealTag<T> tag;
  if constexpr (kComplex<T>) {
    const RealVector<T> zero = vn::Zero(tag);
    return {vn::GetLane(vn::SumOfLanes(tag, vn::OddEven(zero, x.v))),
            vn::GetLane(vn::SumOfLanes(tag, vn::OddEven(x.v, zero)))};
  } else {
    return vn::GetLane(vn::SumOfLanes(tag, x));
  }
}

/// A vector that many numbers multiply: of a complex one i x is kept beside it.
template <class T>
struct Multiplicand {
  Vector<T> x;
  HWY_INLINE explicit Multiplicand(Vector<T> the_x) : x(the_x) {}
  HWY_INLINE Vector<T> subtract_from(Vector<T> y, T number) const {  // y - x number
    return vn::NegMulAdd(x, vn::Set(Tag<T>(), number), y);
  }
};
template <class R>
struct Multiplicand<std::complex<R>> {
  using T = std::complex<R>;
  Vector<T> x, turned;
  HWY_INLINE explicit Multiplicand(Vector<T> the_x) : x(the_x), turned(times_i(the_x)) {}
  HWY_INLINE Vector<T> subtract_from(Vector<T> y, T number) const {
    const RealTag<T> tag;
    const RealVector<T> first = vn::NegMulAdd(x.v, vn::Set(tag, number.real()), y.v);
    return {vn::NegMulAdd(turned.v, vn::Set(tag, number.imag()), first)};
  }
};

/// A number that vectors are multiplied by, its parts apart.
template <class T>
struct Multiplier {
  RealVector<T> re;
  HWY_INLINE explicit Multiplier(const T* y) : re(vn::Set(RealTag<T>(), *y)) {}
};
template <class R>
struct Multiplier<std::complex<R>> {
  using T = std::complex<R>;
  RealVector<T> re, im;
  HWY_INLINE explicit Multiplier(const T* y)
      : re(vn::Set(RealTag<T>(), reinterpret_cast<const R*>(y)[0])),
        im(vn::Set(RealTag<T>(), reinterpret_cast<const R*>(y)[1])) {}
};

/// A sum of products x y. Of complex numbers the products with the parts of y are summed apart, so that nothing is
/// shuffled before the end: x y = x re(y) + i (x im(y)). Where `kConjugate`, y stands for its conjugate.
template <class T, bool kConjugate>
struct ProductSum {
  Vector<T> v;
  HWY_INLINE void start(Vector<T> x) { v = x; }
  template <bool kAdd>
  HWY_INLINE void take(Vector<T> x, const Multiplier<T>& y) {
    v = kAdd ? vn::MulAdd(x, y.re, v) : vn::NegMulAdd(x, y.re, v);
  }
  [[nodiscard]] HWY_INLINE Vector<T> total() const { return v; }
};
template <class R, bool kConjugate>
struct ProductSum<std::complex<R>, kConjugate> {
  using T = std::complex<R>;
  RealVector<T> by_re, by_im;
  HWY_INLINE void start(Vector<T> x) {
    by_re = x.v;
    by_im = vn::Zero(RealTag<T>());
  }
  template <bool kAdd>
  HWY_INLINE void take(Vector<T> x, const Multiplier<T>& y) {
    by_re = kAdd ? vn::MulAdd(x.v, y.re, by_re) : vn::NegMulAdd(x.v, y.re, by_re);
    by_im = kAdd ? vn::MulAdd(x.v, y.im, by_im) : vn::NegMulAdd(x.v, y.im, by_im);
  }
  [[nodiscard]] HWY_INLINE Vector<T> total() const {
    const RealVector<T> turned = times_i(ComplexVector<T>{by_im}).v;
    return {kConjugate ? vn::Sub(by_re, turned) : vn::Add(by_re, turned)};
  }
};

/// x times a real number.
template <class T>
HWY_INLINE Vector<T> scaled(Vector<T> x, RealVector<T> by) {
  if constexpr (kComplex<T>) {
    return {vn::Mul(x.v, by)};
  } else {
    return vn::Mul(x, by);
  }
}

}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard
