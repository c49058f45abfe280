#include "dynamics/elements/hex8_block.hpp"

#include <cmath>

#include "dynamics/elements/hex8_kinematics.hpp"

// AVX-512, AVX2 and the baseline; scalable vectors cannot stand in arrays.
#define HWY_DISABLED_TARGETS                                                                                   \
  (HWY_AVX3_DL | HWY_SSE4 | HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV | HWY_PPC8 | \
   HWY_WASM | HWY_WASM_EMU256)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "dynamics/elements/hex8_block.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "hwy/highway.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::dynamics::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// One element in each lane.
struct Lanes {
  using Tag = hn::CappedTag<double, kMaxLanes>;
  using Mask = hn::Mask<Tag>;
  static constexpr int kWidth = static_cast<int>(HWY_MIN(HWY_LANES(double), kMaxLanes));
  hn::Vec<Tag> v;
  HWY_INLINE Lanes() = default;
  HWY_INLINE explicit Lanes(double x) : v(hn::Set(Tag(), x)) {}
  HWY_INLINE explicit Lanes(hn::Vec<Tag> x) : v(x) {}
  static HWY_INLINE Lanes load(const double* from) { return Lanes(hn::LoadU(Tag(), from)); }
  HWY_INLINE void store(double* to) const { hn::StoreU(v, Tag(), to); }
  static HWY_INLINE Mask all() { return hn::FirstN(Tag(), static_cast<std::size_t>(kWidth)); }
  static HWY_INLINE unsigned bits(Mask mask) {
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(Tag(), mask, bytes);
    return bytes[0];
  }
};
HWY_INLINE Lanes operator+(Lanes a, Lanes b) { return Lanes(hn::Add(a.v, b.v)); }
HWY_INLINE Lanes operator-(Lanes a, Lanes b) { return Lanes(hn::Sub(a.v, b.v)); }
HWY_INLINE Lanes operator*(Lanes a, Lanes b) { return Lanes(hn::Mul(a.v, b.v)); }
HWY_INLINE Lanes operator/(Lanes a, Lanes b) { return Lanes(hn::Div(a.v, b.v)); }
HWY_INLINE Lanes mul_add(Lanes a, Lanes b, Lanes c) { return Lanes(hn::MulAdd(a.v, b.v, c.v)); }
HWY_INLINE Lanes square_root(Lanes a) { return Lanes(hn::Sqrt(a.v)); }
HWY_INLINE Lanes::Mask and_positive(Lanes::Mask mask, Lanes a) {
  return hn::And(mask, hn::Gt(a.v, hn::Zero(Lanes::Tag())));
}

#include "dynamics/elements/hex8_block-inl.hpp"

}  // namespace

Hex8Kernel make_hex8_kernel() { return {Lanes::kWidth, &evaluate_block<Lanes>}; }

}  // namespace espalier::dynamics::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace espalier::dynamics {
namespace scalar {
namespace {

/// One element.
struct Scalar {
  using Mask = bool;
  static constexpr int kWidth = 1;
  double v;
  Scalar() = default;
  explicit Scalar(double x) : v(x) {}
  static Scalar load(const double* from) { return Scalar(*from); }
  void store(double* to) const { *to = v; }
  static Mask all() { return true; }
  static unsigned bits(Mask mask) { return mask ? 1 : 0; }
};
inline Scalar operator+(Scalar a, Scalar b) { return Scalar(a.v + b.v); }
inline Scalar operator-(Scalar a, Scalar b) { return Scalar(a.v - b.v); }
inline Scalar operator*(Scalar a, Scalar b) { return Scalar(a.v * b.v); }
inline Scalar operator/(Scalar a, Scalar b) { return Scalar(a.v / b.v); }
inline Scalar mul_add(Scalar a, Scalar b, Scalar c) { return Scalar(a.v * b.v + c.v); }
inline Scalar square_root(Scalar a) { return Scalar(std::sqrt(a.v)); }
inline bool and_positive(bool mask, Scalar a) { return mask && a.v > 0; }

#include "dynamics/elements/hex8_block-inl.hpp"

}  // namespace
}  // namespace scalar

Hex8Kernel scalar_hex8_kernel() { return {1, &scalar::evaluate_block<scalar::Scalar>}; }

HWY_EXPORT(make_hex8_kernel);

Hex8Kernel vector_hex8_kernel() {
  static const Hex8Kernel kernel = HWY_DYNAMIC_DISPATCH(make_hex8_kernel)();
  return kernel;
}

}  // namespace espalier::dynamics
#endif
