/// \file
/// L U with row pivoting of a diagonal tile and of a small front.
#include "device/host/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/lu.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/micro_kernel-inl.hpp"
// clang-format on
#include <cmath>
#include <utility>

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {

template <class T>
PivotCounts partial_getrf(std::int64_t m, std::int64_t k, T* c, std::int64_t ld, T tiny, std::int32_t* perm,
                          char* replaced) {
  PivotCounts counts;
  for (std::int64_t j = 0; j < k; ++j) perm[j] = static_cast<std::int32_t>(j);
  for (std::int64_t j = 0; j < k; ++j) {
    T* cj = c + j * ld;
    std::int64_t row = j;
    for (std::int64_t i = j + 1; i < k; ++i) {
      if (std::abs(cj[i]) > std::abs(cj[row])) row = i;
    }
    if (row != j) {
      for (std::int64_t l = 0; l < m; ++l) std::swap(c[l * ld + j], c[l * ld + row]);
      std::swap(perm[j], perm[row]);
    }
    replaced[j] = std::abs(cj[j]) < tiny || cj[j] == T(0) ? 1 : 0;
    if (replaced[j] != 0) {
      cj[j] = std::copysign(tiny, cj[j]);
      ++counts.perturbed;
    }
    const T inverse = cj[j] == T(0) ? T(0) : T(1) / cj[j];
    for (std::int64_t i = j + 1; i < m; ++i) cj[i] *= inverse;
    for (std::int64_t l = j + 1; l < m; ++l) {
      const T f = c[l * ld + j];
      for (std::int64_t i = j + 1; i < m; ++i) c[l * ld + i] -= cj[i] * f;
    }
  }
  return counts;
}

template <class T>
PivotCounts getrf(std::int64_t n, T* c, std::int64_t ld, T tiny, std::int32_t* perm, char* replaced) {
  return partial_getrf(n, n, c, ld, tiny, perm, replaced);
}

template <class T>
void fill(Kernels<T>& table) {
  table.getrf = getrf<T>;
  table.partial_getrf = partial_getrf<T>;
}
void fill_double(Kernels<double>& table) { fill(table); }
void fill_float(Kernels<float>& table) { fill(table); }

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace espalier::device::host {
HWY_EXPORT(fill_double);
HWY_EXPORT(fill_float);
template <>
void fill_lu(Kernels<double>& table) {
  HWY_DYNAMIC_DISPATCH(fill_double)(table);
}
template <>
void fill_lu(Kernels<float>& table) {
  HWY_DYNAMIC_DISPATCH(fill_float)(table);
}
}  // namespace espalier::device::host
#endif
