/// \file
/// Substitution with panel tiles: products with A, A^T, W and W^T for one or many right-hand sides.
#include "device/host/kernels/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/kernels/substitution.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/kernels/micro_kernel-inl.hpp"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {
namespace substitution {

/// y(rows of one panel) -= or = A x over `n` columns.
template <class T, bool kAssign>
HWY_INLINE void panel_times_vector(std::int64_t n, const T* HWY_RESTRICT a, const T* HWY_RESTRICT x, T* y) {
  const Tag<T> t;
  constexpr int vectors = kVectors<T>;
  ProductSum<T, false> sum[4][vectors];
  HWY_UNROLL(4)
  for (int u = 0; u < 4; ++u) {
    HWY_UNROLL(16)
    for (int v = 0; v < vectors; ++v) sum[u][v].start(vn::Zero(t));
  }
  std::int64_t k = 0;
  for (; k + 4 <= n; k += 4, a += 4 * kPanel<T>) {
    HWY_UNROLL(4)
    for (int u = 0; u < 4; ++u) {
      const Multiplier<T> xk(x + k + u);
      HWY_UNROLL(16)
      for (int v = 0; v < vectors; ++v)
        sum[u][v].template take<true>(vn::LoadU(t, a + u * kPanel<T> + v * kLanes<T>), xk);
    }
  }
  for (; k < n; ++k, a += kPanel<T>) {
    const Multiplier<T> xk(x + k);
    HWY_UNROLL(16)
    for (int v = 0; v < vectors; ++v) sum[0][v].template take<true>(vn::LoadU(t, a + v * kLanes<T>), xk);
  }
  HWY_UNROLL(16)
  for (int v = 0; v < vectors; ++v) {
    const Vector<T> total =
        vn::Add(vn::Add(sum[0][v].total(), sum[1][v].total()), vn::Add(sum[2][v].total(), sum[3][v].total()));
    T* out = y + v * kLanes<T>;
    vn::StoreU(kAssign ? total : vn::Sub(vn::LoadU(t, out), total), t, out);
  }
}

/// A vector whose elements multiply those of others, its parts apart.
template <class T>
struct Elements {
  RealVector<T> re;
  HWY_INLINE explicit Elements(Vector<T> x) : re(x) {}
};
template <class R>
struct Elements<std::complex<R>> {
  using T = std::complex<R>;
  RealVector<T> re, im;
  HWY_INLINE explicit Elements(Vector<T> x) : re(vn::DupEven(x.v)), im(vn::DupOdd(x.v)) {}
};
/// A sum of products of elements, a x or conj(a) x = conj(a conj(x)).
template <class T, bool kConjugate>
struct ElementSum {
  ProductSum<T, kConjugate> sum;
  HWY_INLINE void take(Vector<T> a, const Elements<T>& x) {
    if constexpr (kComplex<T>) {
      sum.by_re = vn::MulAdd(a.v, x.re, sum.by_re);
      sum.by_im = vn::MulAdd(a.v, x.im, sum.by_im);
    } else {
      sum.v = vn::MulAdd(a, x.re, sum.v);
    }
  }
  [[nodiscard]] HWY_INLINE T total() const { return conjugate<kConjugate>(sum_of<T>(sum.total())); }
};

/// Columns whose sums are kept at a time: a panel is then read in pieces of 4 KiB, which the processor fetches ahead.
inline constexpr std::int64_t kSumColumns = 64;

/// sum[0..columns) += A(:, those)^T x over `kPanels` panels, `stride` numbers apart.
template <class T, int kPanels, bool kConjugate>
HWY_INLINE void add_panels(std::int64_t columns, std::int64_t stride, const T* HWY_RESTRICT a, const T* x,
                           ElementSum<T, kConjugate>* HWY_RESTRICT sum) {
  const Tag<T> t;
  for (std::int64_t j = 0; j < columns; ++j) {
    ElementSum<T, kConjugate> s = sum[j];
    HWY_UNROLL(4)
    for (int q = 0; q < kPanels; ++q) {
      HWY_UNROLL(16)
      for (int v = 0; v < kVectors<T>; ++v)
        s.take(vn::LoadU(t, a + q * stride + j * kPanel<T> + v * kLanes<T>),
               Elements<T>(vn::LoadU(t, x + q * kPanel<T> + v * kLanes<T>)));
    }
    sum[j] = s;
  }
}

/// y[0..columns) -= or = A(:, those)^T x over the panels; `depth` is the distance of panels in columns, of which there
/// are at most kSumColumns.
template <class T, bool kAssign, bool kConjugate>
HWY_INLINE void columns_times_vector(std::int64_t panels, std::int64_t depth, std::int64_t columns, const T* a,
                                     const T* x, T* y) {
  constexpr int together = 4;  // panels
  const Tag<T> t;
  ElementSum<T, kConjugate> sum[kSumColumns];
  for (std::int64_t j = 0; j < columns; ++j) sum[j].sum.start(vn::Zero(t));
  const std::int64_t stride = depth * kPanel<T>;
  std::int64_t q = 0;
  for (; q + together <= panels; q += together, a += together * stride, x += together * kPanel<T>)
    add_panels<T, together, kConjugate>(columns, stride, a, x, sum);
  for (; q < panels; ++q, a += stride, x += kPanel<T>) add_panels<T, 1, kConjugate>(columns, stride, a, x, sum);
  for (std::int64_t j = 0; j < columns; ++j) y[j] = kAssign ? sum[j].total() : y[j] - sum[j].total();
}

/// Y (columns x nr) -= or = A^T X for MP panels of right-hand sides and NR columns of A; a points at the first column.
template <class T, int MP, int NR, bool kAssign, bool kConjugate>
HWY_NOINLINE void transposed_tile(std::int64_t panels, std::int64_t depth, std::int64_t nr, const T* a, const T* x,
                                  T* y) {
  Tile<T, MP, NR> tile;
  const Result<T> result = scratch_of(y, nr);
  if constexpr (kAssign) {
    tile.zero();
  } else {
    tile.load(result);
  }
  for (std::int64_t q = 0; q < panels; ++q, a += depth * kPanel<T>, x += kPanel<T> * nr)
    tile.template multiply_rows<kAssign, kConjugate>(kPanel<T>, scratch_of(x, nr), a, kPanel<T>);
  tile.store(result);
}

template <class T, int MP, bool kAssign, bool kConjugate, int NR = kTileColumns<T>>
HWY_INLINE void transposed_tiles(std::int64_t columns, std::int64_t panels, std::int64_t depth, std::int64_t nr,
                                 const T* a, const T* x, T* y) {
  if (columns == NR) {
    transposed_tile<T, MP, NR, kAssign, kConjugate>(panels, depth, nr, a, x, y);
  } else if constexpr (NR > 1) {
    transposed_tiles<T, MP, kAssign, kConjugate, NR - 1>(columns, panels, depth, nr, a, x, y);
  }
}

/// One group of right-hand sides (1..kTilePanels panels) against `columns` columns of A.
template <class T, bool kAssign, bool kConjugate>
void transposed_group(int group, std::int64_t columns, std::int64_t panels, std::int64_t depth, std::int64_t nr,
                      const T* a, const T* x, T* y) {
  if constexpr (kTilePanels > 2) {
    if (group == 3) return transposed_tiles<T, 3, kAssign, kConjugate>(columns, panels, depth, nr, a, x, y);
  }
  if constexpr (kTilePanels > 1) {
    if (group == 2) return transposed_tiles<T, 2, kAssign, kConjugate>(columns, panels, depth, nr, a, x, y);
  }
  transposed_tiles<T, 1, kAssign, kConjugate>(columns, panels, depth, nr, a, x, y);
}

template <class T>
void apply(std::int64_t m, std::int64_t n, std::int64_t nr, const T* a, const T* x, T* y) {
  constexpr std::int64_t p = kPanel<T>;
  if (nr == 1) {
    for (std::int64_t i = 0; i < m; i += p) panel_times_vector<T, false>(n, a + i * n, x, y + i);
    return;
  }
  for (std::int64_t r = 0; r < nr;) {  // Y^T -= X^T A^T
    const int group = group_panels((nr - r) / p);
    group_product<T, false>(group, m, n, scratch_of(x + r, nr), panels_of(a, n), scratch_of(y + r, nr));
    r += group * p;
  }
}

template <class T>
void apply_lower(std::int64_t n, std::int64_t nr, const T* w, const T* x, T* y) {
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = 0; i < n; i += p) {
    const std::int64_t end = std::min(n, i + p);
    if (nr == 1) {
      panel_times_vector<T, true>(end, w + i * n, x, y + i);
      continue;
    }
    for (std::int64_t r = 0; r < nr;) {
      const int group = group_panels((nr - r) / p);
      group_product<T, true>(group, end - i, end, scratch_of(x + r, nr), panels_of(w + i * n, n),
                             scratch_of(y + i * nr + r, nr));
      r += group * p;
    }
  }
}

/// Y (n x nr) -= or = A^T X, where only the panels from column / P on count when kLower.
template <class T, bool kLower, bool kConjugate>
void apply_transposed_from(std::int64_t m, std::int64_t n, std::int64_t nr, const T* a, const T* x, T* y) {
  constexpr std::int64_t p = kPanel<T>;
  const std::int64_t panels = (m + p - 1) / p;
  const std::int64_t width = nr > 1 ? kTileColumns<T> : kLower ? p : kSumColumns;
  for (std::int64_t j = 0; j < n; j += width) {
    const std::int64_t columns = std::min(width, n - j), first = kLower ? j / p : 0;
    const T* aj = a + first * p * n + j * p;
    if (nr == 1) {
      columns_times_vector<T, kLower, kConjugate>(panels - first, n, columns, aj, x + first * p, y + j);
      continue;
    }
    for (std::int64_t r = 0; r < nr;) {
      const int group = group_panels((nr - r) / p);
      transposed_group<T, kLower, kConjugate>(group, columns, panels - first, n, nr, aj, x + first * p * nr + r,
                                              y + j * nr + r);
      r += group * p;
    }
  }
}

template <class T, bool kConjugate>
void apply_transposed(std::int64_t m, std::int64_t n, std::int64_t nr, const T* a, const T* x, T* y) {
  apply_transposed_from<T, false, kConjugate>(m, n, nr, a, x, y);
}

template <class T, bool kConjugate>
void apply_lower_transposed(std::int64_t n, std::int64_t nr, const T* w, const T* x, T* y) {
  apply_transposed_from<T, true, kConjugate>(n, n, nr, w, x, y);
}

template <class T, bool kConjugate>
void fill(Kernels<T>& table) {
  table.apply = apply<T>;
  table.apply_transposed = apply_transposed<T, kConjugate>;
  table.apply_lower = apply_lower<T>;
  table.apply_lower_transposed = apply_lower_transposed<T, kConjugate>;
}
}  // namespace substitution
ESPALIER_FILL_KERNELS(substitution)

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(substitution)
#endif
