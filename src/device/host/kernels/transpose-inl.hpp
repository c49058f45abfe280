/// \file
/// Transposes of register blocks. Compiled once per instruction set, hence the include guard that toggles.
#if defined(ESPALIER_DEVICE_HOST_TRANSPOSE_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef ESPALIER_DEVICE_HOST_TRANSPOSE_INL
#undef ESPALIER_DEVICE_HOST_TRANSPOSE_INL
#else
#define ESPALIER_DEVICE_HOST_TRANSPOSE_INL
#endif

#include <type_traits>

#include "device/host/kernels/micro_kernel-inl.hpp"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {

#if HWY_TARGET == HWY_SCALAR
template <class T>
HWY_INLINE void transpose(Vector<T>*) {}
#else
/// Elements of one 128-bit block.
template <class T>
inline constexpr int kBlock = static_cast<int>(16 / sizeof(T));

/// Transposes the matrices that the 128-bit blocks of v[0..kBlock) form: 2x2 of double, 4x4 of float.
template <class T>
HWY_INLINE void transpose_in_blocks(Vector<T>* v) {
  const Tag<T> t;
  if constexpr (kBlock<T> == 2) {
    const auto low = hn::InterleaveLower(t, v[0], v[1]);
    v[1] = hn::InterleaveUpper(t, v[0], v[1]);
    v[0] = low;
  } else if constexpr (kBlock<T> == 4) {
    const hn::Repartition<double, Tag<T> > pairs;
    const auto a = hn::BitCast(pairs, hn::InterleaveLower(t, v[0], v[1]));  // 00 10 01 11
    const auto b = hn::BitCast(pairs, hn::InterleaveUpper(t, v[0], v[1]));  // 02 12 03 13
    const auto c = hn::BitCast(pairs, hn::InterleaveLower(t, v[2], v[3]));
    const auto d = hn::BitCast(pairs, hn::InterleaveUpper(t, v[2], v[3]));
    v[0] = hn::BitCast(t, hn::InterleaveLower(pairs, a, c));
    v[1] = hn::BitCast(t, hn::InterleaveUpper(pairs, a, c));
    v[2] = hn::BitCast(t, hn::InterleaveLower(pairs, b, d));
    v[3] = hn::BitCast(t, hn::InterleaveUpper(pairs, b, d));
  }
}

/// Exchanges the 128-bit blocks of `kElements` vectors, of `kBlockElements` elements each, as a transpose does; T is
/// real.
template <class T, int kElements, int kBlockElements>
HWY_INLINE void transpose_blocks(Vector<T>* v) {
  const Tag<T> t;
  constexpr int blocks = kElements / kBlockElements;
  if constexpr (blocks == 2) {
    HWY_UNROLL(16)
    for (int i = 0; i < kBlockElements; ++i) {
      const auto low = hn::ConcatLowerLower(t, v[i + kBlockElements], v[i]);
      v[i + kBlockElements] = hn::ConcatUpperUpper(t, v[i + kBlockElements], v[i]);
      v[i] = low;
    }
  } else if constexpr (blocks == 4) {
    constexpr int s = kBlockElements;
    HWY_UNROLL(16)
    for (int i = 0; i < s; ++i) {
      const auto a = hn::ConcatLowerLower(t, v[i + 2 * s], v[i]);      // blocks 00 01 20 21
      const auto b = hn::ConcatLowerLower(t, v[i + 3 * s], v[i + s]);  // 10 11 30 31
      const auto c = hn::ConcatUpperUpper(t, v[i + 2 * s], v[i]);      // 02 03 22 23
      const auto d = hn::ConcatUpperUpper(t, v[i + 3 * s], v[i + s]);  // 12 13 32 33
      v[i] = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(b), a);          // 00 10 20 30
      v[i + s] = hn::OddEvenBlocks(b, hn::SwapAdjacentBlocks(a));      // 01 11 21 31
      v[i + 2 * s] = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(d), c);  // 02 12 22 32
      v[i + 3 * s] = hn::OddEvenBlocks(d, hn::SwapAdjacentBlocks(c));  // 03 13 23 33
    }
  }
}

/// v[j] lane i becomes v[i] lane j, for kLanes vectors.
template <class T>
HWY_INLINE void transpose(Vector<T>* v) {
  if constexpr (kComplex<T>) {
    constexpr int lanes = kLanes<T>;
    using Element = std::conditional_t<kBlock<T> == 1, Real<T>, double>;  // complex<float> moves like double
    Vector<Element> parts[lanes];
    HWY_UNROLL(16)
    for (int i = 0; i < lanes; ++i) parts[i] = hn::BitCast(Tag<Element>(), v[i].v);
    if constexpr (kBlock<T> == 2) {
      HWY_UNROLL(16)
      for (int i = 0; i < lanes; i += 2) transpose_in_blocks<Element>(parts + i);
    }
    transpose_blocks<Element, lanes, kBlock<T> >(parts);
    HWY_UNROLL(16)
    for (int i = 0; i < lanes; ++i) v[i].v = hn::BitCast(RealTag<T>(), parts[i]);
  } else {
    HWY_UNROLL(16)
    for (int i = 0; i < kLanes<T>; i += kBlock<T>) transpose_in_blocks<T>(v + i);
    transpose_blocks<T, kLanes<T>, kBlock<T> >(v);
  }
}
#endif

}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard
