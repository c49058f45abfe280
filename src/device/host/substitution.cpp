/// \file
/// Substitution with panel tiles: products with A, A^T, W and W^T for one or many right-hand sides.
#include "device/host/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/substitution.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/micro_kernel-inl.hpp"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {

/// y(rows of one panel) -= or = A x over `n` columns.
template <class T, bool kAssign>
HWY_INLINE void panel_times_vector(std::int64_t n, const T* HWY_RESTRICT a, const T* HWY_RESTRICT x, T* y) {
  const Tag<T> t;
  constexpr int vectors = kVectors<T>;
  Vector<T> sum[4][vectors];
  HWY_UNROLL(4)
  for (int u = 0; u < 4; ++u) {
    HWY_UNROLL(16)
    for (int v = 0; v < vectors; ++v) sum[u][v] = hn::Zero(t);
  }
  std::int64_t k = 0;
  for (; k + 4 <= n; k += 4, a += 4 * kPanel<T>) {
    HWY_UNROLL(4)
    for (int u = 0; u < 4; ++u) {
      const Vector<T> xk = hn::Set(t, x[k + u]);
      HWY_UNROLL(16)
      for (int v = 0; v < vectors; ++v)
        sum[u][v] = hn::MulAdd(hn::LoadU(t, a + u * kPanel<T> + v * kLanes<T>), xk, sum[u][v]);
    }
  }
  for (; k < n; ++k, a += kPanel<T>) {
    const Vector<T> xk = hn::Set(t, x[k]);
    HWY_UNROLL(16)
    for (int v = 0; v < vectors; ++v) sum[0][v] = hn::MulAdd(hn::LoadU(t, a + v * kLanes<T>), xk, sum[0][v]);
  }
  HWY_UNROLL(16)
  for (int v = 0; v < vectors; ++v) {
    const Vector<T> total = hn::Add(hn::Add(sum[0][v], sum[1][v]), hn::Add(sum[2][v], sum[3][v]));
    T* out = y + v * kLanes<T>;
    hn::StoreU(kAssign ? total : hn::Sub(hn::LoadU(t, out), total), t, out);
  }
}

/// y[0..columns) -= or = A(:, those)^T x over the panels; `depth` is the distance of panels in columns.
template <class T, bool kAssign>
HWY_INLINE void columns_times_vector(std::int64_t panels, std::int64_t depth, int columns, const T* a, const T* x,
                                     T* y) {
  const Tag<T> t;
  constexpr int group = 8;
  Vector<T> sum[group];
  for (int j = 0; j < group; ++j) sum[j] = hn::Zero(t);
  for (std::int64_t q = 0; q < panels; ++q, a += depth * kPanel<T>, x += kPanel<T>) {
    for (int v = 0; v < kPanel<T>; v += kLanes<T>) {
      const Vector<T> xv = hn::LoadU(t, x + v);
      if (columns == group) {
        HWY_UNROLL(8)
        for (int j = 0; j < group; ++j) sum[j] = hn::MulAdd(hn::LoadU(t, a + j * kPanel<T> + v), xv, sum[j]);
      } else {
        for (int j = 0; j < columns; ++j) sum[j] = hn::MulAdd(hn::LoadU(t, a + j * kPanel<T> + v), xv, sum[j]);
      }
    }
  }
  for (int j = 0; j < columns; ++j) {
    const T total = hn::GetLane(hn::SumOfLanes(t, sum[j]));
    y[j] = kAssign ? total : y[j] - total;
  }
}

/// Y (columns x nr) -= or = A^T X for MP panels of right-hand sides and NR columns of A; a points at the first column.
template <class T, int MP, int NR, bool kAssign>
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
    tile.template multiply_rows<kAssign>(kPanel<T>, scratch_of(x, nr), a, kPanel<T>);
  tile.store(result);
}

template <class T, int MP, bool kAssign, int NR = kTileColumns>
HWY_INLINE void transposed_tiles(std::int64_t columns, std::int64_t panels, std::int64_t depth, std::int64_t nr,
                                 const T* a, const T* x, T* y) {
  if (columns == NR) {
    transposed_tile<T, MP, NR, kAssign>(panels, depth, nr, a, x, y);
  } else if constexpr (NR > 1) {
    transposed_tiles<T, MP, kAssign, NR - 1>(columns, panels, depth, nr, a, x, y);
  }
}

/// One group of right-hand sides (1..kTilePanels panels) against `columns` columns of A.
template <class T, bool kAssign>
void transposed_group(int group, std::int64_t columns, std::int64_t panels, std::int64_t depth, std::int64_t nr,
                      const T* a, const T* x, T* y) {
  if constexpr (kTilePanels > 2) {
    if (group == 3) return transposed_tiles<T, 3, kAssign>(columns, panels, depth, nr, a, x, y);
  }
  if constexpr (kTilePanels > 1) {
    if (group == 2) return transposed_tiles<T, 2, kAssign>(columns, panels, depth, nr, a, x, y);
  }
  transposed_tiles<T, 1, kAssign>(columns, panels, depth, nr, a, x, y);
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
template <class T, bool kLower>
void apply_transposed_from(std::int64_t m, std::int64_t n, std::int64_t nr, const T* a, const T* x, T* y) {
  constexpr std::int64_t p = kPanel<T>;
  constexpr std::int64_t vector_columns = 8;
  const std::int64_t panels = (m + p - 1) / p, width = nr == 1 ? vector_columns : kTileColumns;
  for (std::int64_t j = 0; j < n; j += width) {
    const std::int64_t columns = std::min(width, n - j), first = kLower ? j / p : 0;
    const T* aj = a + first * p * n + j * p;
    if (nr == 1) {
      columns_times_vector<T, kLower>(panels - first, n, static_cast<int>(columns), aj, x + first * p, y + j);
      continue;
    }
    for (std::int64_t r = 0; r < nr;) {
      const int group = group_panels((nr - r) / p);
      transposed_group<T, kLower>(group, columns, panels - first, n, nr, aj, x + first * p * nr + r, y + j * nr + r);
      r += group * p;
    }
  }
}

template <class T>
void apply_transposed(std::int64_t m, std::int64_t n, std::int64_t nr, const T* a, const T* x, T* y) {
  apply_transposed_from<T, false>(m, n, nr, a, x, y);
}

template <class T>
void apply_lower_transposed(std::int64_t n, std::int64_t nr, const T* w, const T* x, T* y) {
  apply_transposed_from<T, true>(n, n, nr, w, x, y);
}

template <class T>
void fill(Kernels<T>& table) {
  table.apply = apply<T>;
  table.apply_transposed = apply_transposed<T>;
  table.apply_lower = apply_lower<T>;
  table.apply_lower_transposed = apply_lower_transposed<T>;
}
void fill_double(Kernels<double>& table) { fill(table); }
void fill_float(Kernels<float>& table) { fill(table); }

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(fill_substitution)
#endif
