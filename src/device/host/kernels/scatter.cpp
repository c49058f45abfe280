#include "device/host/kernels/scatter.hpp"

#include <algorithm>

#include "base/vector_targets.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/kernels/scatter.cpp"
#include "hwy/foreach_target.h"  // compiles this file once per instruction set
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Complex numbers are added part by part.
template <class T>
void add_runs(const Run* runs, Index run_count, const Scatter<T>& t) {
  using Real = typename base::ScalarTraits<T>::Real;
  constexpr Index kParts = base::ScalarTraits<T>::is_complex ? 2 : 1;
  const hn::ScalableTag<Real> d;
  const auto lanes = static_cast<Index>(hn::Lanes(d));
  Index first = 0;
  for (Index c = t.col_begin; c < t.col_end; ++c) {
    const T* column = t.tile + (c - t.col_origin) * t.tile_ld - t.row_origin;
    T* target = t.part + (t.relative[c] - t.part_col_begin) * t.part_ld;
    while (first < run_count && runs[first].end <= c) ++first;
    for (Index q = first; q < run_count; ++q) {
      const Index begin = std::max(runs[q].begin, c);
      const Real* from = reinterpret_cast<const Real*>(column + begin);
      Real* to = reinterpret_cast<Real*>(target + runs[q].target + (begin - runs[q].begin));
      Index left = kParts * (runs[q].end - begin);
      for (; left >= lanes; left -= lanes, from += lanes, to += lanes)
        hn::StoreU(hn::Add(hn::LoadU(d, to), hn::LoadU(d, from)), d, to);
#if HWY_TARGET <= HWY_AVX3 && HWY_ARCH_X86
      if (left > 0) {
        const auto mask = hn::FirstN(d, static_cast<size_t>(left));
        hn::BlendedStore(hn::Add(hn::MaskedLoad(mask, d, to), hn::MaskedLoad(mask, d, from)), mask, d, to);
      }
#else
      for (Index r = 0; r < left; ++r) to[r] += from[r];
#endif
    }
  }
}

void add_runs_f64(const Run* runs, Index n, const Scatter<double>& t) { add_runs(runs, n, t); }
void add_runs_f32(const Run* runs, Index n, const Scatter<float>& t) { add_runs(runs, n, t); }
void add_runs_c64(const Run* runs, Index n, const Scatter<std::complex<double>>& t) { add_runs(runs, n, t); }
void add_runs_c32(const Run* runs, Index n, const Scatter<std::complex<float>>& t) { add_runs(runs, n, t); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace espalier::device::host
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace espalier::device::host {

HWY_EXPORT(add_runs_f64);
HWY_EXPORT(add_runs_f32);
HWY_EXPORT(add_runs_c64);
HWY_EXPORT(add_runs_c32);

template <>
void scatter(const Run* runs, Index run_count, const Scatter<double>& task) {
  HWY_DYNAMIC_DISPATCH(add_runs_f64)(runs, run_count, task);
}

template <>
void scatter(const Run* runs, Index run_count, const Scatter<float>& task) {
  HWY_DYNAMIC_DISPATCH(add_runs_f32)(runs, run_count, task);
}

template <>
void scatter(const Run* runs, Index run_count, const Scatter<std::complex<double>>& task) {
  HWY_DYNAMIC_DISPATCH(add_runs_c64)(runs, run_count, task);
}

template <>
void scatter(const Run* runs, Index run_count, const Scatter<std::complex<float>>& task) {
  HWY_DYNAMIC_DISPATCH(add_runs_c32)(runs, run_count, task);
}

template <class T>
void scatter_mirrored(const Run* runs, Index run_count, const Scatter<T>& t) {
  for (Index c = t.col_begin; c < t.col_end; ++c) {
    const T* column = t.tile + (c - t.col_origin) * t.tile_ld - t.row_origin;
    for (Index q = 0; q < run_count; ++q)
      for (Index r = std::max(runs[q].begin, c + 1); r < runs[q].end; ++r)
        t.part[(runs[q].target + r - runs[q].begin) * t.part_ld + t.relative[c] - t.part_col_begin] += column[r];
  }
}

#define ESPALIER_INSTANTIATE(T) template void scatter_mirrored(const Run*, Index, const Scatter<T>&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
#endif
