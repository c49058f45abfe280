/// \file
/// The two parts of one complex number as a vector, for the scalar target, whose vectors hold a single number: as much
/// of Highway's operations as vector-inl.hpp and its users ask for.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace espalier::device::host::pairs {

template <class R>
struct PairTag {};
template <class R>
struct PairVector {
  R even, odd;
};
struct PairMask {
  bool even, odd;
};

template <class R>
PairVector<R> LoadU(PairTag<R> /*tag*/, const R* p) {
  return {p[0], p[1]};
}
template <class R>
void StoreU(PairVector<R> x, PairTag<R> /*tag*/, R* p) {
  p[0] = x.even;
  p[1] = x.odd;
}
template <class R>
PairVector<R> Zero(PairTag<R> /*tag*/) {
  return {R(0), R(0)};
}
template <class R>
PairVector<R> Set(PairTag<R> /*tag*/, R x) {
  return {x, x};
}
template <class R>
PairVector<R> Iota(PairTag<R> /*tag*/, R first) {
  return {first, first + R(1)};
}
template <class R>
PairVector<R> Add(PairVector<R> x, PairVector<R> y) {
  return {x.even + y.even, x.odd + y.odd};
}
template <class R>
PairVector<R> Sub(PairVector<R> x, PairVector<R> y) {
  return {x.even - y.even, x.odd - y.odd};
}
template <class R>
PairVector<R> Mul(PairVector<R> x, PairVector<R> y) {
  return {x.even * y.even, x.odd * y.odd};
}
template <class R>
PairVector<R> MulAdd(PairVector<R> x, PairVector<R> y, PairVector<R> z) {
  return {x.even * y.even + z.even, x.odd * y.odd + z.odd};
}
template <class R>
PairVector<R> MulSub(PairVector<R> x, PairVector<R> y, PairVector<R> z) {
  return {x.even * y.even - z.even, x.odd * y.odd - z.odd};
}
template <class R>
PairVector<R> NegMulAdd(PairVector<R> x, PairVector<R> y, PairVector<R> z) {
  return {z.even - x.even * y.even, z.odd - x.odd * y.odd};
}
template <class R>
PairVector<R> Neg(PairVector<R> x) {
  return {-x.even, -x.odd};
}
template <class R>
PairVector<R> Abs(PairVector<R> x) {
  return {std::abs(x.even), std::abs(x.odd)};
}
template <class R>
PairVector<R> Floor(PairVector<R> x) {
  return {std::floor(x.even), std::floor(x.odd)};
}
template <class R>
PairVector<R> Max(PairVector<R> x, PairVector<R> y) {
  return {std::max(x.even, y.even), std::max(x.odd, y.odd)};
}
template <class R>
PairVector<R> Reverse2(PairTag<R> /*tag*/, PairVector<R> x) {
  return {x.odd, x.even};
}
template <class R>
PairVector<R> OddEven(PairVector<R> odd, PairVector<R> even) {
  return {even.even, odd.odd};
}
template <class R>
PairVector<R> DupEven(PairVector<R> x) {
  return {x.even, x.even};
}
template <class R>
PairVector<R> DupOdd(PairVector<R> x) {
  return {x.odd, x.odd};
}
template <class R>
PairMask Eq(PairVector<R> x, PairVector<R> y) {
  return {x.even == y.even, x.odd == y.odd};
}
template <class R>
PairMask Ne(PairVector<R> x, PairVector<R> y) {
  return {x.even != y.even, x.odd != y.odd};
}
template <class R>
PairMask Gt(PairVector<R> x, PairVector<R> y) {
  return {x.even > y.even, x.odd > y.odd};
}
template <class R>
PairMask Ge(PairVector<R> x, PairVector<R> y) {
  return {x.even >= y.even, x.odd >= y.odd};
}
template <class R>
PairMask Lt(PairVector<R> x, PairVector<R> y) {
  return {x.even < y.even, x.odd < y.odd};
}
inline PairMask And(PairMask x, PairMask y) { return {x.even && y.even, x.odd && y.odd}; }
template <class R>
PairMask FirstN(PairTag<R> /*tag*/, std::size_t n) {
  return {n > 0, n > 1};
}
template <class R>
PairVector<R> IfThenElse(PairMask mask, PairVector<R> yes, PairVector<R> no) {
  return {mask.even ? yes.even : no.even, mask.odd ? yes.odd : no.odd};
}
template <class R>
PairVector<R> IfThenElseZero(PairMask mask, PairVector<R> yes) {
  return {mask.even ? yes.even : R(0), mask.odd ? yes.odd : R(0)};
}
template <class R>
std::int64_t FindFirstTrue(PairTag<R> /*tag*/, PairMask mask) {
  return mask.even ? 0 : mask.odd ? 1 : -1;
}
template <class R>
R GetLane(PairVector<R> x) {
  return x.even;
}
template <class R>
PairVector<R> MaxOfLanes(PairTag<R> /*tag*/, PairVector<R> x) {
  const R most = std::max(x.even, x.odd);
  return {most, most};
}
template <class R>
PairVector<R> SumOfLanes(PairTag<R> /*tag*/, PairVector<R> x) {
  return {x.even + x.odd, x.even + x.odd};
}

}  // namespace espalier::device::host::pairs
