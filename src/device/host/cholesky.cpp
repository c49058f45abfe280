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
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {

/// The factors of one block column of kTileColumns columns as the rows below need them.
template <class T>
struct Block {
  T lower[kTileColumns][kTileColumns];  ///< lower[j][l] = entry (l, j) of the unit lower factor L D^-1/2
  T scale[kTileColumns];                ///< D^-1/2
};

/// Factors the diagonal block whose columns stand in `tile`, of which the first `width` are pivots, in the form
/// L D L^T, so that only one division stands between two columns; then L D^1/2 goes to c. `c` is the panel of rows that
/// holds the diagonal, which begins in its row `shift`.
/// @returns width, or the first column whose pivot is not positive
template <class T>
HWY_INLINE int factor_diagonal(Tile<T, 1, kTileColumns>& tile, int width, int shift, Result<T> c, Block<T>& block) {
  using Whole = Tile<T, 1, kTileColumns>;
  const Tag<T> tag;
  T pivots[kTileColumns];
  HWY_UNROLL(8)
  for (int j = 0; j < kTileColumns; ++j) {
    if (j >= width) break;
    T* column = c.p + j * c.step;
    HWY_UNROLL(24)
    for (int i = 0; i < Whole::kRows; ++i) hn::StoreU(tile.v[j][i], tag, column + i * kLanes<T>);
    pivots[j] = column[shift + j];
    const T inverse = T(1) / pivots[j];
    block.scale[j] = inverse;
    const Vector<T> factor = hn::Set(tag, inverse);
    HWY_UNROLL(8)
    for (int l = j + 1; l < kTileColumns; ++l) {
      const Vector<T> row = hn::Set(tag, column[shift + l]);
      block.lower[j][l] = column[shift + l] * inverse;
      HWY_UNROLL(24)
      for (int i = 0; i < Whole::kRows; ++i)
        tile.v[l][i] = hn::NegMulAdd(hn::Mul(tile.v[j][i], row), factor, tile.v[l][i]);
    }
  }
  for (int j = 0; j < width; ++j) {
    if (!(pivots[j] >= std::numeric_limits<T>::min())) return j;
    block.scale[j] *= std::sqrt(pivots[j]);
  }
  return width;
}

/// tile = tile L^-T for the first `width` columns; the others lose their part.
template <class T, int MP>
HWY_INLINE void solve(Tile<T, MP, kTileColumns>& tile, int width, const Block<T>& block) {
  const Tag<T> tag;
  HWY_UNROLL(8)
  for (int j = 0; j < kTileColumns; ++j) {
    if (j >= width) break;
    HWY_UNROLL(8)
    for (int l = j + 1; l < kTileColumns; ++l) {
      const Vector<T> row = hn::Set(tag, block.lower[j][l]);
      HWY_UNROLL(24)
      for (int i = 0; i < Tile<T, MP, kTileColumns>::kRows; ++i)
        tile.v[l][i] = hn::NegMulAdd(tile.v[j][i], row, tile.v[l][i]);
    }
  }
}

/// Stores L = tile D^-1/2 (pivot columns) and the rest as it is.
template <class T, int MP>
HWY_INLINE void scale_and_store(Tile<T, MP, kTileColumns>& tile, int width, const Block<T>& block, Result<T> c) {
  HWY_UNROLL(8)
  for (int j = 0; j < kTileColumns; ++j) {
    if (j >= width) break;
    const Vector<T> scale = hn::Set(Tag<T>(), block.scale[j]);
    HWY_UNROLL(24)
    for (int i = 0; i < Tile<T, MP, kTileColumns>::kRows; ++i) tile.v[j][i] = hn::Mul(tile.v[j][i], scale);
  }
  tile.store(c);
}

/// The rows of MP panels in the block column: minus the products of the columns to the left, then the solve.
template <class T, int MP>
HWY_NOINLINE void eliminate_rows(std::int64_t depth, int width, Operand<T> a, const T* b, const Block<T>& block,
                                 Result<T> c) {
  Tile<T, MP, kTileColumns> tile;
  tile.load(c);
  tile.template multiply<false>(depth, a, b, a.step);
  if (width == kTileColumns) {
    solve(tile, kTileColumns, block);
    scale_and_store(tile, kTileColumns, block, c);
  } else {
    solve(tile, width, block);
    scale_and_store(tile, width, block, c);
  }
}

template <class T>
HWY_NOINLINE int eliminate_diagonal(std::int64_t depth, int width, int shift, Operand<T> a, const T* b, Block<T>& block,
                                    Result<T> c) {
  Tile<T, 1, kTileColumns> tile;
  tile.load(c);
  tile.template multiply<false>(depth, a, b, a.step);
  const int done = factor_diagonal(tile, width, shift, c, block);
  scale_and_store(tile, width, block, c);
  return done;
}

/// Left-looking by block columns of kTileColumns, each register tile read and written once. The last block column may
/// hold columns that are no pivots; they are updated with it, which leaves whole block columns for the final product.
template <class T>
std::int64_t partial_potrf(std::int64_t m, std::int64_t k, T* c, std::int64_t ld) {
  constexpr std::int64_t p = kPanel<T>;
  const Operand<T> left{c, p, ld};
  const Result<T> result = scratch_of(c, ld);
  Block<T> block;
  for (std::int64_t j = 0; j < k; j += kTileColumns) {
    const int width = static_cast<int>(std::min<std::int64_t>(kTileColumns, k - j));
    const std::int64_t top = j / p * p;
    const T* b = c + j;
    const int done =
        eliminate_diagonal(j, width, static_cast<int>(j - top), left.at(top, 0), b, block, result.at(top, j));
    if (done < width) return j + done;
    for (std::int64_t i = top + p; i < m;) {
      const int panels = group_panels((m - i + p - 1) / p);
      const Operand<T> a = left.at(i, 0);
      const Result<T> r = result.at(i, j);
      if (panels == 1) {
        eliminate_rows<T, 1>(j, width, a, b, block, r);
      } else if constexpr (kTilePanels == 3) {
        if (panels == 2) {
          eliminate_rows<T, 2>(j, width, a, b, block, r);
        } else {
          eliminate_rows<T, 3>(j, width, a, b, block, r);
        }
      }
      i += panels * p;
    }
  }
  const std::int64_t next = (k + kTileColumns - 1) / kTileColumns * kTileColumns;
  lower_product<T>(m, next, m, k, left, left, result);
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
ESPALIER_KERNEL_PART(fill_cholesky)
#endif
