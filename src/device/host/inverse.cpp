/// \file
/// Inverses of triangular tiles, in panels.
#include "device/host/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/inverse.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/micro_kernel-inl.hpp"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {

/// w = inverse of the lower triangular matrix with elements at c[i * rows + j * columns].
template <class T>
void invert(std::int64_t n, const T* c, std::int64_t rows, std::int64_t columns, bool unit, T* w) {
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = 0; i < padded<T>(n) * n; ++i) w[i] = T(0);
  const auto at = [&](std::int64_t i, std::int64_t j) -> T& { return w[i / p * p * n + j * p + i % p]; };
  for (std::int64_t j = 0; j < n; ++j) {
    at(j, j) = unit ? T(1) : T(1) / c[j * rows + j * columns];
    for (std::int64_t i = j + 1; i < n; ++i) {
      T sum = T(0);
      for (std::int64_t l = j; l < i; ++l) sum -= c[i * rows + l * columns] * at(l, j);
      at(i, j) = unit ? sum : sum / c[i * rows + i * columns];
    }
  }
}

template <class T>
void invert_lower(std::int64_t n, const T* c, std::int64_t ld, bool unit, T* w) {
  invert(n, c, 1, ld, unit, w);
}

template <class T>
void invert_upper_transposed(std::int64_t n, const T* c, std::int64_t ld, T* w) {
  invert(n, c, ld, 1, false, w);
}

template <class T>
void fill(Kernels<T>& table) {
  table.invert_lower = invert_lower<T>;
  table.invert_upper_transposed = invert_upper_transposed<T>;
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
void fill_inverse(Kernels<double>& table) {
  HWY_DYNAMIC_DISPATCH(fill_double)(table);
}
template <>
void fill_inverse(Kernels<float>& table) {
  HWY_DYNAMIC_DISPATCH(fill_float)(table);
}
}  // namespace espalier::device::host
#endif
