/// \file
/// The lane type of several elements side by side, for one instruction set of Highway: included within its namespace,
/// so there is no include guard. See lane_algebra-inl.hpp.

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
HWY_INLINE Lanes log_one_plus(Lanes a) { return Lanes(hn::CallLog1p(Lanes::Tag(), a.v)); }
HWY_INLINE Lanes magnitude(Lanes a) { return Lanes(hn::Abs(a.v)); }
HWY_INLINE Lanes larger(Lanes a, Lanes b) { return Lanes(hn::Max(a.v, b.v)); }
HWY_INLINE Lanes select(Lanes::Mask mask, Lanes yes, Lanes no) { return Lanes(hn::IfThenElse(mask, yes.v, no.v)); }
HWY_INLINE Lanes::Mask mask_and(Lanes::Mask a, Lanes::Mask b) { return hn::And(a, b); }
HWY_INLINE Lanes::Mask mask_or(Lanes::Mask a, Lanes::Mask b) { return hn::Or(a, b); }
HWY_INLINE Lanes::Mask mask_not(Lanes::Mask a) { return hn::Not(a); }
HWY_INLINE Lanes::Mask and_positive(Lanes::Mask mask, Lanes a) {
  return hn::And(mask, hn::Gt(a.v, hn::Zero(Lanes::Tag())));
}
