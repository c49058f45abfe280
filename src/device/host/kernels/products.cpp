/// \file
/// Products of panel tiles: gemm_nt, syrk_nt, trmm_nt.
#include "device/host/kernels/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/kernels/products.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/kernels/micro_kernel-inl.hpp"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {
namespace products {

/// Depth of one pass over C: a row group of 24 x 160 doubles and its column panels stay in a 48 KiB first-level cache.
inline constexpr std::int64_t kDepth = 160;

/// Length of each of the fewest equal passes of at most kDepth.
std::int64_t pass_depth(std::int64_t k) {
  const std::int64_t passes = std::max<std::int64_t>(1, (k + kDepth - 1) / kDepth);
  return (k + passes - 1) / passes;
}

template <class T, bool kConjugate>
void gemm_nt(std::int64_t m, std::int64_t n, std::int64_t k, const T* a, const T* b, T* c, std::int64_t ld) {
  const Operand<T> left = panels_of(a, k), right = panels_of(b, k);
  const Result<T> result = scratch_of(c, ld);
  constexpr std::int64_t p = kPanel<T>;
  const std::int64_t depth = pass_depth(k);
  for (std::int64_t l = 0; l < k; l += depth) {
    for (std::int64_t i = 0; i < m;) {
      const int panels = group_panels((m - i + p - 1) / p);
      group_product<T, false, kConjugate>(panels, n, std::min(depth, k - l), left.at(i, l), right.at(0, l),
                                          result.at(i, 0));
      i += panels * p;
    }
  }
}

template <class T, bool kConjugate>
void syrk_nt(std::int64_t m, std::int64_t n, std::int64_t k, const T* a, const T* b, T* c, std::int64_t ld) {
  const Operand<T> left = panels_of(a, k), right = panels_of(b, k);
  const std::int64_t depth = pass_depth(k);
  for (std::int64_t l = 0; l < k; l += depth)
    lower_product<T, kConjugate>(m, 0, n, std::min(depth, k - l), left.at(0, l), right.at(0, l), scratch_of(c, ld));
}

template <class T, bool kConjugate>
void trmm_nt(std::int64_t m, std::int64_t n, const T* b, const T* w, T* x) {
  const Operand<T> left = panels_of(b, n), right = panels_of(w, n);
  const Result<T> result = panels_of(x, n);
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = 0; i < m;) {
    const int panels = group_panels((m - i + p - 1) / p);
    for (std::int64_t j = 0; j < n; j += p) {
      const std::int64_t end = std::min(n, j + p);  // W is zero beyond
      group_product<T, true, kConjugate>(panels, end - j, end, left.at(i, 0), right.at(j, 0), result.at(i, j));
    }
    i += panels * p;
  }
}

template <class T, bool kConjugate>
void fill(Kernels<T>& table) {
  table.target = hwy::TargetName(HWY_TARGET);
  table.gemm_nt = gemm_nt<T, kConjugate>;
  table.syrk_nt = syrk_nt<T, kConjugate>;
  table.trmm_nt = trmm_nt<T, kConjugate>;
}
}  // namespace products
ESPALIER_FILL_KERNELS(products)

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(products)
#endif
