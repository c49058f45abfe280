/// \file
/// L L^T, of complex tiles L L^H, of a diagonal tile and of a small front.
#include "device/host/kernels/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/kernels/cholesky.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/kernels/micro_kernel-inl.hpp"
// clang-format on
#include <cmath>
#include <limits>

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {
namespace cholesky {

/// The factors of one block column of kTileColumns<T> columns as the rows below need them.
template <class T>
struct Block {
  T lower[kTileColumns<T>][kTileColumns<T>];  ///< lower[j][l] = conjugate of entry (l, j) of the unit lower factor
  Real<T> scale[kTileColumns<T>];             ///< D^-1/2
};

/// Factors the diagonal block whose columns stand in `tile`, of which the first `width` are pivots, in the form
/// L D L^T, so that only one division stands between two columns; then L D^1/2 goes to c. `c` is the panel of rows that
/// holds the diagonal, which begins in its row `shift`.
/// @returns width, or the first column whose pivot is not positive
template <class T>
HWY_INLINE int factor_diagonal(Tile<T, 1, kTileColumns<T>>& tile, int width, int shift, Result<T> c, Block<T>& block) {
  using Whole = Tile<T, 1, kTileColumns<T>>;
  const Tag<T> tag;
  Real<T> pivots[kTileColumns<T>];
  HWY_UNROLL(8)
  for (int j = 0; j < kTileColumns<T>; ++j) {
    if (j >= width) break;
    T* column = c.p + j * c.step;
    HWY_UNROLL(24)
    for (int i = 0; i < Whole::kRows; ++i) vn::StoreU(tile.v[j][i], tag, column + i * kLanes<T>);
    pivots[j] = real_of(column[shift + j]);
    const Real<T> inverse = Real<T>(1) / pivots[j];
    block.scale[j] = inverse;
    const Vector<T> factor = vn::Set(tag, T(inverse));
    HWY_UNROLL(8)
    for (int l = j + 1; l < kTileColumns<T>; ++l) {
      const T entry = conjugate<true>(column[shift + l]);
      const Vector<T> row = vn::Set(tag, entry);
      block.lower[j][l] = entry * inverse;
      HWY_UNROLL(24)
      for (int i = 0; i < Whole::kRows; ++i)
        tile.v[l][i] = vn::NegMulAdd(vn::Mul(tile.v[j][i], row), factor, tile.v[l][i]);
    }
  }
  for (int j = 0; j < width; ++j) {
    if (!(pivots[j] >= std::numeric_limits<Real<T>>::min())) return j;
    block.scale[j] *= std::sqrt(pivots[j]);
  }
  return width;
}

/// tile = tile L^-T for the first `width` columns; the others lose their part.
template <class T, int MP>
HWY_INLINE void solve(Tile<T, MP, kTileColumns<T>>& tile, int width, const Block<T>& block) {
  using Whole = Tile<T, MP, kTileColumns<T>>;
  HWY_UNROLL(8)
  for (int j = 0; j < kTileColumns<T>; ++j) {
    if (j >= width) break;
    HWY_UNROLL(24)
    for (int i = 0; i < Whole::kRows; ++i) {
      const Multiplicand<T> x(tile.v[j][i]);
      HWY_UNROLL(8)
      for (int l = j + 1; l < kTileColumns<T>; ++l) tile.v[l][i] = x.subtract_from(tile.v[l][i], block.lower[j][l]);
    }
  }
}

/// Stores L = tile D^-1/2 (pivot columns) and the rest as it is.
template <class T, int MP>
HWY_INLINE void scale_and_store(Tile<T, MP, kTileColumns<T>>& tile, int width, const Block<T>& block, Result<T> c) {
  HWY_UNROLL(8)
  for (int j = 0; j < kTileColumns<T>; ++j) {
    if (j >= width) break;
    const RealVector<T> scale = vn::Set(RealTag<T>(), block.scale[j]);
    HWY_UNROLL(24)
    for (int i = 0; i < Tile<T, MP, kTileColumns<T>>::kRows; ++i) tile.v[j][i] = scaled<T>(tile.v[j][i], scale);
  }
  tile.store(c);
}

/// The rows of MP panels in the block column: minus the products of the columns to the left, then the solve.
template <class T, int MP>
HWY_NOINLINE void eliminate_rows(std::int64_t depth, int width, Operand<T> a, const T* b, const Block<T>& block,
                                 Result<T> c) {
  Tile<T, MP, kTileColumns<T>> tile;
  tile.load(c);
  tile.template multiply<false, true>(depth, a, b, a.step);
  if (width == kTileColumns<T>) {
    solve(tile, kTileColumns<T>, block);
    scale_and_store(tile, kTileColumns<T>, block, c);
  } else {
    solve(tile, width, block);
    scale_and_store(tile, width, block, c);
  }
}

template <class T>
HWY_NOINLINE int eliminate_diagonal(std::int64_t depth, int width, int shift, Operand<T> a, const T* b, Block<T>& block,
                                    Result<T> c) {
  Tile<T, 1, kTileColumns<T>> tile;
  tile.load(c);
  tile.template multiply<false, true>(depth, a, b, a.step);
  const int done = factor_diagonal(tile, width, shift, c, block);
  scale_and_store(tile, width, block, c);
  if constexpr (kComplex<T>) {  // rounding leaves imaginary parts on the diagonal
    for (int j = 0; j < width; ++j) c.p[j * c.step + shift + j] = real_of(c.p[j * c.step + shift + j]);
  }
  return done;
}

/// Left-looking by block columns of kTileColumns<T>, each register tile read and written once. The last block column
/// may hold columns that are no pivots; they are updated with it, which leaves whole block columns for the final
/// product.
template <class T>
std::int64_t partial_potrf(std::int64_t m, std::int64_t k, T* c, std::int64_t ld) {
  constexpr std::int64_t p = kPanel<T>;
  const Operand<T> left{c, p, ld};
  const Result<T> result = scratch_of(c, ld);
  Block<T> block;
  for (std::int64_t j = 0; j < k; j += kTileColumns<T>) {
    const int width = static_cast<int>(std::min<std::int64_t>(kTileColumns<T>, k - j));
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
  const std::int64_t next = (k + kTileColumns<T> - 1) / kTileColumns<T> * kTileColumns<T>;
  lower_product<T, true>(m, next, m, k, left, left, result);
  return k;
}

template <class T>
std::int64_t potrf(std::int64_t n, T* c, std::int64_t ld) {
  return partial_potrf(n, n, c, ld);
}

template <class T, bool>
void fill(Kernels<T>& table) {
  table.potrf = potrf<T>;
  table.partial_potrf = partial_potrf<T>;
}
}  // namespace cholesky
ESPALIER_FILL_KERNELS(cholesky)

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(cholesky)
#endif
