#include "solve/row_sums.hpp"

#include "base/at.hpp"
#include "base/vector_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solve/row_sums.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "hwy/highway.h"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::solve::HWY_NAMESPACE {
#if HWY_NATIVE_FMA
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// A cache line of right-hand sides at most: the rows of x are then read whole.
using Lanes = hn::CappedTag<double, 8>;
using Vector = hn::Vec<Lanes>;

// A sum of products in twice the working precision: TwoProduct by fused multiply-add, TwoSum of Knuth, as for a single
// right-hand side in residual.cpp. Two of them follow each other through the row, so that the processor can work on
// both.
struct LongSum {
  Vector high, low, scale;

  HWY_INLINE void subtract_product(Vector a, Vector b) {
    const Vector product = hn::Mul(a, b);
    const Vector error = hn::NegMulAdd(a, b, product);  // product - a b, exact
    const Vector sum = hn::Sub(high, product);
    const Vector z = hn::Sub(sum, high);
    const Vector lost = hn::Sub(hn::Sub(high, hn::Sub(sum, z)), hn::Add(product, z));
    low = hn::Add(low, hn::Add(lost, error));
    high = sum;
    scale = hn::Add(scale, hn::Abs(product));
  }
};

void sum_row(const RowEntries& row, const double* x, const double* b, double* residual, double* scale) {
  const Lanes tag;
  const std::size_t width = hn::Lanes(tag);
  const Vector start = hn::LoadU(tag, b), zero = hn::Zero(tag);
  LongSum even{start, zero, hn::Abs(start)}, odd{zero, zero, zero};
  const auto add = [&](LongSum& sum, std::size_t q) HWY_ATTR {
    sum.subtract_product(hn::Set(tag, row.values[q]), hn::LoadU(tag, x + at(row.cols[q]) * width));
  };
  const std::size_t count = row.values.size();
  std::size_t q = 0;
  for (; q + 1 < count; q += 2) {
    add(even, q);
    add(odd, q + 1);
  }
  if (q < count) add(even, q);
  const Vector high = hn::Add(even.high, odd.high);
  const Vector z = hn::Sub(high, even.high);
  const Vector lost = hn::Add(hn::Sub(even.high, hn::Sub(high, z)), hn::Sub(odd.high, z));
  hn::StoreU(hn::Add(high, hn::Add(even.low, hn::Add(lost, odd.low))), tag, residual);
  hn::StoreU(hn::Add(even.scale, odd.scale), tag, scale);
}

}  // namespace

RowSums make_row_sums() { return {static_cast<Index>(hn::Lanes(Lanes())), &sum_row}; }
#else
RowSums make_row_sums() { return {}; }
#endif

}  // namespace espalier::solve::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace espalier::solve {

HWY_EXPORT(make_row_sums);

const RowSums& row_sums() {
  static const RowSums sums = HWY_DYNAMIC_DISPATCH(make_row_sums)();
  return sums;
}

}  // namespace espalier::solve
#endif
