/// \file
/// L L^T of a diagonal tile and of a small front.
#include "device/host/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/cholesky.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/micro_kernel-inl.hpp"
// clang-format on
#include <cmath>

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {

template <class T>
std::int64_t partial_potrf(std::int64_t m, std::int64_t k, T* c, std::int64_t ld) {
  for (std::int64_t j = 0; j < k; ++j) {
    T* cj = c + j * ld;
    if (!(cj[j] > T(0))) return j;
    cj[j] = std::sqrt(cj[j]);
    for (std::int64_t i = j + 1; i < m; ++i) cj[i] /= cj[j];
    for (std::int64_t l = j + 1; l < m; ++l) {
      const T f = cj[l];
      for (std::int64_t i = l; i < m; ++i) c[l * ld + i] -= cj[i] * f;
    }
  }
  return k;
}

template <class T>
std::int64_t potrf(std::int64_t n, T* c, std::int64_t ld) {
  return partial_potrf(n, n, c, ld);
}

template <class T>
void fill(Kernels<T>& table) {
  table.potrf = potrf<T>;
  table.partial_potrf = partial_potrf<T>;
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
void fill_cholesky(Kernels<double>& table) {
  HWY_DYNAMIC_DISPATCH(fill_double)(table);
}
template <>
void fill_cholesky(Kernels<float>& table) {
  HWY_DYNAMIC_DISPATCH(fill_float)(table);
}
}  // namespace espalier::device::host
#endif
