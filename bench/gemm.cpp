/// \file
/// General matrix product on column-major arrays, on one thread.
#include "gemm.hpp"

#include "device/host/kernels/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "gemm.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/kernels/micro_kernel-inl.hpp"
#include "device/host/kernels/transpose-inl.hpp"
// clang-format on
#include "device/host/scratch.hpp"
#include "hwy/cache_control.h"

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {

/// Blocks as in Goto and van de Geijn (2008, ACM TOMS 34): kDepth x kWidth of op(B), 1 MiB of double, stay in the
/// second-level cache while row groups of op(A), kDepth deep, pass by.
inline constexpr std::int64_t kDepth = 192;
inline constexpr std::int64_t kWidth = 768;
/// Up to this many rows, the columns of B are not worth packing; up to this many columns, those of A are not.
inline constexpr std::int64_t kDirect = 128;

/// op(X) with element (i, l) at p[i * row + l * column], one of the strides being 1.
template <class T>
struct View {
  const T* p;
  std::int64_t row;
  std::int64_t column;

  [[nodiscard]] View at(std::int64_t i, std::int64_t l) const { return {p + i * row + l * column, row, column}; }
};

/// One panel of `rows` <= P rows and `depth` columns; rows that are missing become zero.
template <class T>
void pack_panel(std::int64_t rows, std::int64_t depth, const View<T>& x, T* panel) {
  const Tag<T> tag;
  constexpr std::int64_t p = kPanel<T>;
  constexpr int lanes = kLanes<T>;
  std::int64_t l = 0;
  if (rows == p && x.row == 1) {
    for (; l < depth; ++l) {
      HWY_UNROLL(16)
      for (int v = 0; v < p; v += lanes) hn::StoreU(hn::LoadU(tag, x.p + l * x.column + v), tag, panel + l * p + v);
    }
  } else if (rows == p) {
    for (; l + lanes <= depth; l += lanes) {
      for (int part = 0; part < p; part += lanes) {
        Vector<T> v[lanes];
        HWY_UNROLL(16)
        for (int i = 0; i < lanes; ++i) v[i] = hn::LoadU(tag, x.p + (part + i) * x.row + l);
        transpose<T>(v);
        HWY_UNROLL(16)
        for (int i = 0; i < lanes; ++i) hn::StoreU(v[i], tag, panel + (l + i) * p + part);
      }
    }
  }
  for (; l < depth; ++l) {
    for (std::int64_t i = 0; i < p; ++i) panel[l * p + i] = i < rows ? x.p[i * x.row + l * x.column] : T(0);
  }
}

/// C = alpha * tile + beta * C.
template <class T, int MP>
HWY_INLINE void combine(const Tile<T, MP, kTileColumns<T>>& tile, T alpha, T beta, Result<T> c) {
  const Tag<T> tag;
  const Vector<T> a = hn::Set(tag, alpha), b = hn::Set(tag, beta);
  HWY_UNROLL(8)
  for (int j = 0; j < kTileColumns<T>; ++j) {
    HWY_UNROLL(24)
    for (int i = 0; i < Tile<T, MP, kTileColumns<T>>::kRows; ++i) {
      T* out = c.p + Tile<T, MP, kTileColumns<T>>::offset(i, c.panel) + j * c.step;
      const Vector<T> scaled = hn::Mul(a, tile.v[j][i]);
      hn::StoreU(beta == T(0) ? scaled : hn::MulAdd(b, hn::LoadU(tag, out), scaled), tag, out);
    }
  }
}

/// A product of one row group with kTileColumns<T> columns of op(B), whose element (l, j) stands at b[l * step + j] or,
/// when step is 0, at b[l + j * stride].
template <class T>
struct Step {
  std::int64_t depth;
  Operand<T> a;
  const T* b;
  std::int64_t step;
  std::int64_t stride;
  T alpha;
  T beta;
};

/// tile += steps [begin, end) of the sum.
template <class T, int MP>
HWY_INLINE void add_steps(Tile<T, MP, kTileColumns<T>>& tile, const Step<T>& s, std::int64_t begin, std::int64_t end) {
  const Operand<T> a = s.a.at(0, begin);
  if (s.step != 0) {
    for (std::int64_t l = begin; l < end; ++l) hwy::Prefetch(s.b + (l + s.depth) * s.step);  // of the next columns
    tile.template multiply<true>(end - begin, a, s.b + begin * s.step, s.step);
  } else {
    tile.template multiply_rows<true>(end - begin, a, s.b + begin, s.stride);
  }
}

template <class T, int MP>
HWY_INLINE void prefetch_column(Result<T> c, int j) {
  using Whole = Tile<T, MP, kTileColumns<T>>;
  for (int i = 0; i < Whole::kRows; i += kVectors<T>) hwy::Prefetch(c.p + Whole::offset(i, c.panel) + j * c.step);
}

/// In a deep product the lines of C are fetched one column at a time between parts of the sum: all at once they would
/// take the fill buffers that the operands need.
template <class T, int MP>
HWY_NOINLINE void group_tile(const Step<T>& s, Result<T> c) {
  Tile<T, MP, kTileColumns<T>> tile;
  tile.zero();
  std::int64_t l = 0;
  const std::int64_t part = s.depth / kTileColumns<T>;
  for (int j = 0; j < kTileColumns<T>; ++j) {
    prefetch_column<T, MP>(c, j);
    if (part < 16) continue;
    add_steps<T, MP>(tile, s, l, l + part);
    l += part;
  }
  add_steps<T, MP>(tile, s, l, s.depth);
  combine<T, MP>(tile, s.alpha, s.beta, c);
}

template <class T>
HWY_INLINE void tile_of(int panels, const Step<T>& s, Result<T> c) {
  if constexpr (kTilePanels == 3) {
    if (panels == 3) return group_tile<T, 3>(s, c);
    if (panels == 2) return group_tile<T, 2>(s, c);
  }
  group_tile<T, 1>(s, c);
}

/// A tile that sticks out of C: computed beside it.
template <class T>
void ragged_tile(int panels, std::int64_t rows, std::int64_t columns, Step<T> s, T* c, std::int64_t ldc) {
  constexpr std::int64_t height = kTilePanels * kPanel<T>;
  alignas(64) T beside[height * kTileColumns<T>];
  const T beta = s.beta;
  s.beta = T(0);
  tile_of<T>(panels, s, Result<T>{beside, kPanel<T>, height});
  for (std::int64_t j = 0; j < columns; ++j) {
    for (std::int64_t i = 0; i < rows; ++i) {
      T& out = c[j * ldc + i];
      out = beta == T(0) ? beside[j * height + i] : beta * out + beside[j * height + i];
    }
  }
}

/// Room for the packed operands of one pass.
template <class T>
struct Packed {
  T* group;  ///< kTilePanels panels of op(A)
  T* block;  ///< kWidth columns of op(B)
};

/// The row group of op(A) from its first row: where it stands, if it can be used from there, else packed.
template <class T>
Operand<T> row_group(int panels, std::int64_t rows, std::int64_t depth, const View<T>& a, bool direct, T* memory) {
  constexpr std::int64_t p = kPanel<T>;
  if (direct && a.row == 1 && rows >= panels * p) return {a.p, p, a.column};
  for (int q = 0; q < panels; ++q)
    pack_panel<T>(std::min(p, rows - q * p), depth, a.at(q * p, 0), memory + q * p * depth);
  return {memory, p * depth, p};
}

/// C (m x n) = alpha A B + beta C for one block, n <= kWidth, depth <= kDepth. `b` holds rows of op(B)^T.
template <class T>
void block_product(std::int64_t m, std::int64_t n, std::int64_t depth, T alpha, const View<T>& a, const View<T>& b,
                   T beta, T* c, std::int64_t ldc, const Packed<T>& packed) {
  constexpr std::int64_t p = kPanel<T>;
  const bool direct_b = m <= kDirect, direct_a = n <= kDirect;
  for (std::int64_t j = direct_b ? n / p * p : 0; j < n; j += p)
    pack_panel<T>(std::min(p, n - j), depth, b.at(j, 0), packed.block + j * depth);
  for (std::int64_t i = 0; i < m;) {
    const int panels = group_panels((m - i + p - 1) / p);
    const std::int64_t rows = std::min<std::int64_t>(panels * p, m - i);
    const Operand<T> group = row_group(panels, rows, depth, a.at(i, 0), direct_a, packed.group);
    for (std::int64_t j = 0; j < n; j += kTileColumns<T>) {
      const bool stands = direct_b && j < n / p * p;
      const T* column = stands ? b.at(j, 0).p : packed.block + j / p * p * depth + j % p;
      const std::int64_t b_step = !stands ? p : b.row == 1 ? b.column : 0;
      const Step<T> step{depth, group, column, b_step, b.row, alpha, beta};
      const std::int64_t columns = std::min<std::int64_t>(kTileColumns<T>, n - j);
      T* out = c + j * ldc + i;
      if (rows == panels * p && columns == kTileColumns<T>) {
        tile_of<T>(panels, step, Result<T>{out, p, ldc});
      } else {
        ragged_tile<T>(panels, rows, columns, step, out, ldc);
      }
    }
    i += panels * p;
  }
}

template <class T>
void product(std::int64_t m, std::int64_t n, std::int64_t k, T alpha, const View<T>& a, const View<T>& b, T beta, T* c,
             std::int64_t ldc) {
  const std::int64_t widest = std::min(kWidth, padded<T>(n)), deepest = std::min(kDepth, k);
  T* memory = scratch<T>((kTilePanels * kPanel<T> + widest) * deepest);
  const Packed<T> packed{memory, memory + kTilePanels * kPanel<T> * deepest};
  const std::int64_t passes = std::max<std::int64_t>(1, (k + kDepth - 1) / kDepth);
  const std::int64_t depth = std::max<std::int64_t>(1, (k + passes - 1) / passes);
  for (std::int64_t j = 0; j < n; j += kWidth) {
    const std::int64_t columns = std::min(kWidth, n - j);
    for (std::int64_t l = 0; l < std::max<std::int64_t>(k, 1); l += depth)
      block_product(m, columns, std::min(depth, k - l), alpha, a.at(0, l), b.at(j, l), l == 0 ? beta : T(1),
                    c + j * ldc, ldc, packed);
  }
}

void product_double(std::int64_t m, std::int64_t n, std::int64_t k, double alpha, const double* a, std::int64_t a_row,
                    std::int64_t a_column, const double* b, std::int64_t b_row, std::int64_t b_column, double beta,
                    double* c, std::int64_t ldc) {
  product<double>(m, n, k, alpha, {a, a_row, a_column}, {b, b_row, b_column}, beta, c, ldc);
}
void product_float(std::int64_t m, std::int64_t n, std::int64_t k, float alpha, const float* a, std::int64_t a_row,
                   std::int64_t a_column, const float* b, std::int64_t b_row, std::int64_t b_column, float beta,
                   float* c, std::int64_t ldc) {
  product<float>(m, n, k, alpha, {a, a_row, a_column}, {b, b_row, b_column}, beta, c, ldc);
}

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace espalier::device::host {
HWY_EXPORT(product_double);
HWY_EXPORT(product_float);

template <>
void gemm(bool transpose_a, bool transpose_b, std::int64_t m, std::int64_t n, std::int64_t k, double alpha,
          const double* a, std::int64_t lda, const double* b, std::int64_t ldb, double beta, double* c,
          std::int64_t ldc) {
  HWY_DYNAMIC_DISPATCH(product_double)
  (m, n, k, alpha, a, transpose_a ? lda : 1, transpose_a ? 1 : lda, b, transpose_b ? 1 : ldb, transpose_b ? ldb : 1,
   beta, c, ldc);
}
template <>
void gemm(bool transpose_a, bool transpose_b, std::int64_t m, std::int64_t n, std::int64_t k, float alpha,
          const float* a, std::int64_t lda, const float* b, std::int64_t ldb, float beta, float* c, std::int64_t ldc) {
  HWY_DYNAMIC_DISPATCH(product_float)
  (m, n, k, alpha, a, transpose_a ? lda : 1, transpose_a ? 1 : lda, b, transpose_b ? 1 : ldb, transpose_b ? ldb : 1,
   beta, c, ldc);
}
}  // namespace espalier::device::host
#endif
