/// \file
/// Search for the largest entry of a column. Compiled once per instruction set, hence the include guard that toggles.
#if defined(ESPALIER_DEVICE_HOST_PIVOT_SEARCH_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef ESPALIER_DEVICE_HOST_PIVOT_SEARCH_INL
#undef ESPALIER_DEVICE_HOST_PIVOT_SEARCH_INL
#else
#define ESPALIER_DEVICE_HOST_PIVOT_SEARCH_INL
#endif

#include "device/host/kernels/micro_kernel-inl.hpp"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {

/// Rows that a search looks at: begin <= row < end, row != skip.
struct Range {
  std::int64_t begin;
  std::int64_t end;
  std::int64_t skip;

  [[nodiscard]] bool covers(std::int64_t row, std::int64_t rows) const {
    return begin <= row && row + rows <= end && (skip < row || skip >= row + rows);
  }
};

/// |x| of the elements whose rows, from `row` on, lie in the range; zero elsewhere.
template <class T>
HWY_INLINE RealVector<T> magnitudes(Vector<T> x, std::int64_t row, const Range& range) {
  const RealTag<T> tag;
  const auto number = [&](std::int64_t k) HWY_ATTR { return vn::Set(tag, static_cast<Real<T>>(k)); };
  const RealVector<T> rows = element_numbers<T>(row);
  const auto inside = vn::And(vn::Ge(rows, number(range.begin)), vn::Lt(rows, number(range.end)));
  const auto kept = vn::And(inside, vn::Ne(rows, number(range.skip)));
  return vn::IfThenElseZero(kept, magnitude_of<T>(x));
}

/// The first row in the range with this magnitude; range.skip when there is none (NaN).
template <class T>
std::int64_t find_row(const T* column, Real<T> magnitude, const Range& range) {
  const RealVector<T> value = vn::Set(RealTag<T>(), magnitude);
  for (std::int64_t i = range.begin / kPanel<T> * kPanel<T>; i < range.end; i += kLanes<T>) {
    const auto hits = vn::Eq(magnitudes<T>(vn::LoadU(Tag<T>(), column + i), i, range), value);
    const std::int64_t part = vn::FindFirstTrue(RealTag<T>(), hits);
    if (part >= 0 && magnitude > Real<T>(0)) return i + part / kParts<T>;
  }
  return range.skip;
}

}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard
