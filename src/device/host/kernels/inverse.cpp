/// \file
/// Inverses of triangular tiles, in panels.
#include "device/host/kernels/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/kernels/inverse.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/kernels/micro_kernel-inl.hpp"
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {
namespace inverse {

/// How the entries of the lower triangular factor L are found: L(i, j) at p[i * row + j * column], where one of the
/// strides is 1.
template <class T>
struct Factor {
  const T* p;
  std::int64_t row;
  std::int64_t column;
};

/// Diagonal block of L as register tiles need it.
template <class T>
struct Block {
  T lower[kTileColumns<T>][kTileColumns<T>];  ///< lower[j][l] = L(j, l) for l < j
  T inverse[kTileColumns<T>];                 ///< 1 / L(l, l)
};

template <class T>
Block<T> diagonal_block(const Factor<T>& f, std::int64_t begin, int width, bool unit) {
  Block<T> block;
  const T* d = f.p + begin * (f.row + f.column);
  for (int l = 0; l < width; ++l) {
    block.inverse[l] = unit ? T(1) : T(1) / d[l * (f.row + f.column)];
    if constexpr (kTileColumns < T >> 1)
      for (int j = l + 1; j < width; ++j) block.lower[j][l] = d[j * f.row + l * f.column];
  }
  return block;
}

/// tile = the columns begin .. begin + kTileColumns of the identity in the rows of the tile, which start at `row`.
template <class T, int MP>
HWY_INLINE void load_identity(Tile<T, MP, kTileColumns<T>>& tile, std::int64_t row, std::int64_t begin) {
  const Tag<T> tag;
  HWY_UNROLL(8)
  for (int j = 0; j < kTileColumns<T>; ++j) {
    HWY_UNROLL(24)
    for (int i = 0; i < Tile<T, MP, kTileColumns<T>>::kRows; ++i) {
      const RealVector<T> rows = element_numbers<T>(row - begin + i * kLanes<T>);
      const auto here = vn::Eq(rows, vn::Set(RealTag<T>(), static_cast<Real<T>>(j)));
      tile.v[j][i] = vn::IfThenElseZero(here, vn::Set(tag, T(1)));
    }
  }
}

/// tile = tile L^-1 for the diagonal block L of `width` columns, from the last column to the first.
template <class T, int MP>
HWY_INLINE void solve(Tile<T, MP, kTileColumns<T>>& tile, int width, const Block<T>& block) {
  const Tag<T> tag;
  HWY_UNROLL(8)
  for (int j = kTileColumns<T> - 1; j >= 0; --j) {
    if (j >= width) continue;
    const Vector<T> inverse = vn::Set(tag, block.inverse[j]);
    HWY_UNROLL(24)
    for (int i = 0; i < Tile<T, MP, kTileColumns<T>>::kRows; ++i) {
      tile.v[j][i] = vn::Mul(tile.v[j][i], inverse);
      const Multiplicand<T> x(tile.v[j][i]);
      HWY_UNROLL(8)
      for (int l = 0; l < j; ++l) tile.v[l][i] = x.subtract_from(tile.v[l][i], block.lower[j][l]);
    }
  }
}

/// Rows of MP panels from `row` on of the block column [begin, begin + width) of W, whose columns to the right are
/// known: W(:, block) = (E - W(:, right) L(right, block)) L(block, block)^-1, where W ends at its diagonal.
template <class T, int MP>
HWY_NOINLINE void inverse_rows(std::int64_t n, std::int64_t row, std::int64_t begin, int width, const Factor<T>& f,
                               const Block<T>& block, T* w) {
  Tile<T, MP, kTileColumns<T>> tile;
  const std::int64_t right = begin + width, depth = std::min(n, row + MP * kPanel<T>) - right;
  load_identity(tile, row, begin);
  const Result<T> result = panels_of(w, n).at(row, 0);
  const Operand<T> a{result.p + right * kPanel<T>, result.panel, result.step};
  const T* b = f.p + right * f.row + begin * f.column;
  if (f.row == 1) {
    tile.template multiply_rows<false>(depth, a, b, f.column);
  } else {
    tile.template multiply<false>(depth, a, b, f.row);
  }
  const Result<T> out = result.at(0, begin);
  if (width == kTileColumns<T>) {
    solve(tile, kTileColumns<T>, block);
    tile.store(out);
  } else {
    solve(tile, width, block);
    tile.store_columns(width, out);
  }
}

/// w = L^-1 in panels, by block columns from the last to the first.
template <class T>
void invert(std::int64_t n, const Factor<T>& f, bool unit, T* w) {
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t begin = (n - 1) / kTileColumns<T> * kTileColumns<T>; begin >= 0; begin -= kTileColumns<T>) {
    const int width = static_cast<int>(std::min<std::int64_t>(kTileColumns<T>, n - begin));
    const Block<T> block = diagonal_block(f, begin, width, unit);
    for (std::int64_t i = 0; i < begin / p * p; i += p)
      std::fill(w + i * n + begin * p, w + i * n + (begin + width) * p, T(0));
    for (std::int64_t i = begin / p * p; i < n;) {
      const int panels = group_panels((n - i + p - 1) / p);
      if (panels == 1) {
        inverse_rows<T, 1>(n, i, begin, width, f, block, w);
      } else if constexpr (kTilePanels == 3) {
        if (panels == 2) {
          inverse_rows<T, 2>(n, i, begin, width, f, block, w);
        } else {
          inverse_rows<T, 3>(n, i, begin, width, f, block, w);
        }
      }
      i += panels * p;
    }
  }
}

template <class T>
void invert_lower(std::int64_t n, const T* c, std::int64_t ld, bool unit, T* w) {
  if (n > 0) invert(n, Factor<T>{c, 1, ld}, unit, w);
}

template <class T>
void invert_upper_transposed(std::int64_t n, const T* c, std::int64_t ld, T* w) {
  if (n > 0) invert(n, Factor<T>{c, ld, 1}, false, w);
}

template <class T, bool>
void fill(Kernels<T>& table) {
  table.invert_lower = invert_lower<T>;
  table.invert_upper_transposed = invert_upper_transposed<T>;
}
}  // namespace inverse
ESPALIER_FILL_KERNELS(inverse)

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(inverse)
#endif
