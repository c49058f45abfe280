/// \file
/// Search for the largest entry of a column. Compiled once per instruction set, hence the include guard that toggles.
#if defined(ESPALIER_DEVICE_HOST_PIVOT_SEARCH_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef ESPALIER_DEVICE_HOST_PIVOT_SEARCH_INL
#undef ESPALIER_DEVICE_HOST_PIVOT_SEARCH_INL
#else
#define ESPALIER_DEVICE_HOST_PIVOT_SEARCH_INL
#endif

#include "device/host/micro_kernel-inl.hpp"
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

/// |x| in the lanes whose rows, from `row` on, lie in the range; zero elsewhere.
template <class T>
HWY_INLINE Vector<T> magnitudes(Vector<T> x, std::int64_t row, const Range& range) {
  const Tag<T> tag;
  const Vector<T> rows = hn::Iota(tag, static_cast<T>(row));
  const auto inside = hn::And(hn::Ge(rows, hn::Set(tag, static_cast<T>(range.begin))),
                              hn::Lt(rows, hn::Set(tag, static_cast<T>(range.end))));
  const auto kept = hn::And(inside, hn::Ne(rows, hn::Set(tag, static_cast<T>(range.skip))));
  return hn::IfThenElseZero(kept, hn::Abs(x));
}

/// The first row in the range with this magnitude; range.skip when there is none (NaN).
template <class T>
std::int64_t find_row(const T* column, T magnitude, const Range& range) {
  const Tag<T> tag;
  const Vector<T> value = hn::Set(tag, magnitude);
  for (std::int64_t i = range.begin / kPanel<T> * kPanel<T>; i < range.end; i += kLanes<T>) {
    const auto hits = hn::Eq(magnitudes<T>(hn::LoadU(tag, column + i), i, range), value);
    const std::int64_t lane = hn::FindFirstTrue(tag, hits);
    if (lane >= 0 && magnitude > T(0)) return i + lane;
  }
  return range.skip;
}

}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard
