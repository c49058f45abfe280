/// \file
/// Register tiles: the inner loop that all products and factorizations of the host backend share. Compiled once per
/// instruction set, hence the include guard that toggles.
#if defined(ESPALIER_DEVICE_HOST_MICRO_KERNEL_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef ESPALIER_DEVICE_HOST_MICRO_KERNEL_INL
#undef ESPALIER_DEVICE_HOST_MICRO_KERNEL_INL
#else
#define ESPALIER_DEVICE_HOST_MICRO_KERNEL_INL
#endif

#include <algorithm>
#include <cstdint>

#include "device/host/kernels/vector-inl.hpp"
#include "hwy/cache_control.h"
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
/// Shape of the largest register tile: kTilePanels row panels by kRealTileColumns columns. 24 accumulators of 32
/// registers with AVX-512 (3 loads and 8 broadcasts feed 24 FMA), 8 of 16 with AVX2, 16 of 32 with NEON.
#if HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
inline constexpr int kTilePanels = 3;
inline constexpr int kRealTileColumns = 8;
#elif HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_NEON
inline constexpr int kTilePanels = 1;
inline constexpr int kRealTileColumns = 4;
#else
inline constexpr int kTilePanels = 1;
inline constexpr int kRealTileColumns = 2;
#endif
/// Complex products have two accumulators each.
template <class T>
inline constexpr int kTileColumns = kRealTileColumns / kParts<T>;

/// An operand of a product: element (i, k) at p[(i / P) * panel + k * step + i % P]. Panels of a tile with `depth`
/// columns have panel = P * depth, step = P; column-major scratch has panel = P, step = ld.
template <class T>
struct Operand {
  const T* p;
  std::int64_t panel;
  std::int64_t step;

  /// The operand that starts at row i (a multiple of P) and column k.
  [[nodiscard]] Operand at(std::int64_t i, std::int64_t k) const {
    return {p + i / kPanel<T> * panel + k * step, panel, step};
  }
  /// Address of row i and column k.
  [[nodiscard]] const T* element(std::int64_t i, std::int64_t k) const {
    return p + i / kPanel<T> * panel + i % kPanel<T> + k * step;
  }
};

/// The same for a result that is written.
template <class T>
struct Result {
  T* p;
  std::int64_t panel;
  std::int64_t step;

  [[nodiscard]] Result at(std::int64_t i, std::int64_t k) const {
    return {p + i / kPanel<T> * panel + k * step, panel, step};
  }
};

template <class T>
Operand<T> panels_of(const T* p, std::int64_t depth) {
  return {p, kPanel<T> * depth, kPanel<T>};
}
template <class T>
Result<T> panels_of(T* p, std::int64_t depth) {
  return {p, kPanel<T> * depth, kPanel<T>};
}
template <class T>
Operand<T> scratch_of(const T* p, std::int64_t ld) {
  return {p, kPanel<T>, ld};
}
template <class T>
Result<T> scratch_of(T* p, std::int64_t ld) {
  return {p, kPanel<T>, ld};
}

/// MP row panels by NR columns of accumulators.
template <class T, int MP, int NR>
struct Tile {
  static constexpr int kRows = MP * kVectors<T>;  ///< vectors in a column
  Vector<T> v[NR][kRows];

  static HWY_INLINE std::int64_t offset(int i, std::int64_t panel) {
    return i / kVectors<T> * panel + i % kVectors<T> * kLanes<T>;
  }
  HWY_INLINE void zero() {
    HWY_UNROLL(8)
    for (int j = 0; j < NR; ++j) {
      HWY_UNROLL(24)
      for (int i = 0; i < kRows; ++i) v[j][i] = vn::Zero(Tag<T>());
    }
  }
  HWY_INLINE void load(Result<T> c) {
    HWY_UNROLL(8)
    for (int j = 0; j < NR; ++j) {
      HWY_UNROLL(24)
      for (int i = 0; i < kRows; ++i) v[j][i] = vn::LoadU(Tag<T>(), c.p + offset(i, c.panel) + j * c.step);
    }
  }
  HWY_INLINE void store(Result<T> c) const {
    HWY_UNROLL(8)
    for (int j = 0; j < NR; ++j) {
      HWY_UNROLL(24)
      for (int i = 0; i < kRows; ++i) vn::StoreU(v[j][i], Tag<T>(), c.p + offset(i, c.panel) + j * c.step);
    }
  }
  /// Stores the first `columns` columns.
  HWY_INLINE void store_columns(int columns, Result<T> c) const {
    HWY_UNROLL(8)
    for (int j = 0; j < NR; ++j) {
      if (j >= columns) break;
      HWY_UNROLL(24)
      for (int i = 0; i < kRows; ++i) vn::StoreU(v[j][i], Tag<T>(), c.p + offset(i, c.panel) + j * c.step);
    }
  }
  /// v -= (or, when kAdd, +=) sum over k of A(:, k) B(j, k) with B(j, k), or where kConjugate its conjugate, at
  /// b[k * step + j].
  template <bool kAdd, bool kConjugate = false>
  HWY_INLINE void multiply(std::int64_t k, Operand<T> a, const T* HWY_RESTRICT b, std::int64_t step) {
    sum_products<kAdd, kConjugate>(k, a, b, step, [](int j) HWY_ATTR { return j; });
  }
  /// The same with B(j, k) at b[j * stride + k].
  template <bool kAdd, bool kConjugate = false>
  HWY_INLINE void multiply_rows(std::int64_t k, Operand<T> a, const T* HWY_RESTRICT b, std::int64_t stride) {
    sum_products<kAdd, kConjugate>(k, a, b, 1, [stride](int j) HWY_ATTR { return j * stride; });
  }

 private:
  template <bool kAdd, bool kConjugate, class Place>
  HWY_INLINE void sum_products(std::int64_t k, Operand<T> a, const T* HWY_RESTRICT b, std::int64_t step,
                               const Place& place) {
    ProductSum<T, kConjugate> sum[NR][kRows];
    HWY_UNROLL(8)
    for (int j = 0; j < NR; ++j) {
      HWY_UNROLL(24)
      for (int i = 0; i < kRows; ++i) sum[j][i].start(v[j][i]);
    }
    const T* HWY_RESTRICT pa = a.p;
    for (std::int64_t l = 0; l < k; ++l) {
      Vector<T> x[kRows];
      HWY_UNROLL(24)
      for (int i = 0; i < kRows; ++i) x[i] = vn::LoadU(Tag<T>(), pa + offset(i, a.panel));
      HWY_UNROLL(8)
      for (int j = 0; j < NR; ++j) {
        const Multiplier<T> y(b + place(j));
        HWY_UNROLL(24)
        for (int i = 0; i < kRows; ++i) sum[j][i].template take<kAdd>(x[i], y);
      }
      pa += a.step;
      b += step;
    }
    HWY_UNROLL(8)
    for (int j = 0; j < NR; ++j) {
      HWY_UNROLL(24)
      for (int i = 0; i < kRows; ++i) v[j][i] = sum[j][i].total();
    }
  }
};

/// C -= A B^T (kAdd false) or C = A B^T (kAdd true) for one register tile; where kConjugate, B^H. So in all below.
template <class T, int MP, int NR, bool kAdd, bool kConjugate>
HWY_INLINE void tile_product(std::int64_t k, Operand<T> a, const T* b, std::int64_t b_step, Result<T> c) {
  Tile<T, MP, NR> tile;
  if constexpr (kAdd) {
    tile.zero();
  } else {
    tile.load(c);
  }
  tile.template multiply<kAdd, kConjugate>(k, a, b, b_step);
  tile.store(c);
}

/// The last 1 <= columns < kTileColumns<T> of a row group.
template <class T, int MP, bool kAdd, bool kConjugate, int NR = kTileColumns<T> - 1>
HWY_NOINLINE void narrow_product(std::int64_t columns, std::int64_t k, Operand<T> a, const T* b, std::int64_t b_step,
                                 Result<T> c) {
  if constexpr (NR > 0) {
    if (columns == NR) return tile_product<T, MP, NR, kAdd, kConjugate>(k, a, b, b_step, c);
    return narrow_product<T, MP, kAdd, kConjugate, NR - 1>(columns, k, a, b, b_step, c);
  }
}

/// MP row panels against n columns.
template <class T, int MP, bool kAdd, bool kConjugate>
HWY_NOINLINE void group_product(std::int64_t n, std::int64_t k, Operand<T> a, Operand<T> b, Result<T> c) {
  std::int64_t j = 0;
  for (; j + kTileColumns<T> <= n; j += kTileColumns<T>)
    tile_product<T, MP, kTileColumns<T>, kAdd, kConjugate>(k, a, b.element(j, 0), b.step, c.at(0, j));
  if (j < n) narrow_product<T, MP, kAdd, kConjugate>(n - j, k, a, b.element(j, 0), b.step, c.at(0, j));
}

/// Panels of the next row group when `left` panels are left: as many as fit a register tile, without leaving a single
/// panel for last (its eight accumulators hardly cover the latency of the FMA units).
inline int group_panels(std::int64_t left) {
  if (left > kTilePanels + 1 || left <= kTilePanels) return static_cast<int>(std::min<std::int64_t>(left, kTilePanels));
  return static_cast<int>(left + 1) / 2;
}

/// One row group of 1..kTilePanels panels against n columns: C -= A B^T or (kAdd) C = A B^T.
template <class T, bool kAdd, bool kConjugate = false>
HWY_INLINE void group_product(int panels, std::int64_t n, std::int64_t k, const Operand<T>& a, const Operand<T>& b,
                              const Result<T>& c) {
  if constexpr (kTilePanels > 2) {
    if (panels == 3) return group_product<T, 3, kAdd, kConjugate>(n, k, a, b, c);
  }
  if constexpr (kTilePanels > 1) {
    if (panels == 2) return group_product<T, 2, kAdd, kConjugate>(n, k, a, b, c);
  }
  group_product<T, 1, kAdd, kConjugate>(n, k, a, b, c);
}

/// C(i, j) -= A B^T for j in [begin, end) and i in [j, m) at least (whole panels of rows are updated); indices count in
/// the operands, whose row 0 is the first of a panel.
template <class T, bool kConjugate = false>
void lower_product(std::int64_t m, std::int64_t begin, std::int64_t end, std::int64_t k, Operand<T> a, Operand<T> b,
                   Result<T> c) {
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = begin / p * p; i < m;) {
    const int panels = group_panels((m - i + p - 1) / p);
    const std::int64_t stop = std::min(end, i + panels * p);
    for (std::int64_t j = begin; j < stop; j += kTileColumns<T>) {
      const std::int64_t columns = std::min<std::int64_t>(kTileColumns<T>, stop - j);
      const std::int64_t skip = j > i ? (j - i) / p : 0;  // panels above the diagonal
      const std::int64_t row = i + skip * p;
      group_product<T, false, kConjugate>(panels - static_cast<int>(skip), columns, k, a.at(row, 0),
                                          {b.element(j, 0), b.panel, b.step}, c.at(row, j));
    }
    i += panels * p;
  }
}

}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // include guard
