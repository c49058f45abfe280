/// \file
/// L U with row pivoting of a diagonal tile and of a small front.
#include "device/host/kernels/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/kernels/lu.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/kernels/micro_kernel-inl.hpp"
#include "device/host/kernels/pivot_search-inl.hpp"
// clang-format on
#include <cmath>
#include <utility>

#include "device/host/scratch.hpp"

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {
namespace lu {

/// A front under elimination by block columns of kPanel columns, left-looking.
template <class T>
struct Elimination {
  std::int64_t m;  ///< rows and columns
  std::int64_t k;  ///< pivots
  T* c;
  std::int64_t ld;
  ZeroPivot<Real<T>> zero;
  std::int32_t* perm;
  char* replaced;
  T* inverses;          ///< per pivot block: inverse of its unit lower triangle, P x P column-major
  std::int64_t* pivot;  ///< step s exchanged rows s and pivot[s]
  PivotCounts counts = {};
};

/// Exchanges the rows of steps [begin, end) in columns [first, last).
template <class T>
void exchange_rows(const Elimination<T>& f, std::int64_t begin, std::int64_t end, std::int64_t first,
                   std::int64_t last) {
  for (std::int64_t j = first; j < last; ++j) {
    T* column = f.c + j * f.ld;
    for (std::int64_t s = begin; s < end; ++s) {
      const T x = column[s], y = column[f.pivot[s]];
      column[s] = y;
      column[f.pivot[s]] = x;
    }
  }
}

/// One row panel of a register tile of U: C - L U of the panels above, then the inverse of the diagonal block times it.
template <class T>
HWY_NOINLINE void upper_tile(std::int64_t depth, Operand<T> a, const T* b, const T* inverse, Result<T> c) {
  constexpr int p = kPanel<T>;
  Tile<T, 1, kTileColumns<T>> tile;
  tile.load(c);
  tile.template multiply_rows<false>(depth, a, b, c.step);
  alignas(64) T x[kTileColumns<T> * p];
  tile.store({x, p, p});
  tile.zero();
  tile.template multiply_rows<true>(p, {inverse, p, p}, x, p);
  tile.store(c);
}

/// MP row panels of one register tile: C -= L U.
template <class T, int MP>
HWY_NOINLINE void lower_tile(std::int64_t depth, Operand<T> a, const T* b, Result<T> c) {
  Tile<T, MP, kTileColumns<T>> tile;
  tile.load(c);
  tile.template multiply_rows<false>(depth, a, b, c.step);
  tile.store(c);
}

/// The block column at j: U in the `done` rows above (whole panels), the rest reduced by the product.
template <class T>
void update_block_column(const Elimination<T>& f, std::int64_t j, std::int64_t depth, std::int64_t done) {
  constexpr std::int64_t p = kPanel<T>;
  const Operand<T> left{f.c, p, f.ld};
  const Result<T> result = scratch_of(f.c, f.ld);
  for (std::int64_t column = j; column < j + p; column += kTileColumns<T>) {
    const T* b = f.c + column * f.ld;
    for (std::int64_t s = 0; s < done; s += p)
      upper_tile<T>(s, left.at(s, 0), b, f.inverses + s * p, result.at(s, column));
    for (std::int64_t i = done; i < f.m;) {
      const int panels = group_panels((f.m - i + p - 1) / p);
      if (panels == 1) {
        lower_tile<T, 1>(depth, left.at(i, 0), b, result.at(i, column));
      } else if constexpr (kTilePanels == 3) {
        if (panels == 2) {
          lower_tile<T, 2>(depth, left.at(i, 0), b, result.at(i, column));
        } else {
          lower_tile<T, 3>(depth, left.at(i, 0), b, result.at(i, column));
        }
      }
      i += panels * p;
    }
  }
}

/// Divides column `step` below the diagonal by its pivot and subtracts its multiples from the columns up to `end`.
/// @returns the largest magnitude of the next column among its pivot candidates
template <class T>
Real<T> eliminate_column(const Elimination<T>& f, std::int64_t step, std::int64_t end, T inverse) {
  constexpr std::int64_t p = kPanel<T>;
  const Tag<T> tag;
  const Range next{step + 1, f.k, -1};
  const Vector<T> factor = vn::Set(tag, inverse);
  const RealVector<T> diagonal = vn::Set(RealTag<T>(), static_cast<Real<T>>(step));
  RealVector<T> largest = vn::Zero(RealTag<T>());
  T* column = f.c + step * f.ld;
  T row[kPanel<T>];
  for (std::int64_t l = step + 1; l < end; ++l) row[l - step - 1] = f.c[l * f.ld + step];
  const std::int64_t top = step / p * p;
  for (std::int64_t i = top; i < f.m; i += kLanes<T>) {
    const Vector<T> x = vn::LoadU(tag, column + i);
    Vector<T> l = vn::Mul(x, factor);
    if (i < top + p) {  // rows of U stay
      const auto below = vn::Gt(element_numbers<T>(i), diagonal);
      vn::StoreU(vn::IfThenElse(below, l, x), tag, column + i);
      l = vn::IfThenElseZero(below, l);
    } else {
      vn::StoreU(l, tag, column + i);
    }
    T* other = column + f.ld + i;
    const Multiplicand<T> multiplied(l);
    for (std::int64_t n = 0; n < end - step - 1; ++n, other += f.ld) {
      const Vector<T> y = multiplied.subtract_from(vn::LoadU(tag, other), row[n]);
      vn::StoreU(y, tag, other);
      if (n == 0) largest = vn::Max(largest, magnitudes<T>(y, i, next));
    }
  }
  return vn::GetLane(vn::MaxOfLanes(RealTag<T>(), largest));
}

/// Largest magnitude of column j in rows [j, k).
template <class T>
Real<T> column_largest(const Elimination<T>& f, std::int64_t j) {
  const Tag<T> tag;
  RealVector<T> largest = vn::Zero(RealTag<T>());
  for (std::int64_t i = j / kPanel<T> * kPanel<T>; i < f.k; i += kLanes<T>)
    largest = vn::Max(largest, magnitudes<T>(vn::LoadU(tag, f.c + j * f.ld + i), i, {j, f.k, -1}));
  return vn::GetLane(vn::MaxOfLanes(RealTag<T>(), largest));
}

/// Pivots [j, end) in the block column [j, j + P), which is up to date.
template <class T>
void factor_block_column(Elimination<T>& f, std::int64_t j, std::int64_t end) {
  const std::int64_t last = j + kPanel<T>;
  Real<T> largest = column_largest(f, j);
  for (std::int64_t s = j; s < end; ++s) {
    T* column = f.c + s * f.ld;
    const std::int64_t found = find_row(column, largest, {s, f.k, -1});
    f.pivot[s] = found < 0 ? s : found;  // none when all are zero or NaN
    std::swap(f.perm[s], f.perm[f.pivot[s]]);
    exchange_rows(f, s, s + 1, j, last);
    f.replaced[s] = magnitude_of(column[s]) < f.zero.below || column[s] == T(0) ? 1 : 0;
    if (f.replaced[s] != 0) {
      column[s] = replacement(f.zero.instead, column[s]);
      ++f.counts.perturbed;
    }
    largest = eliminate_column(f, s, last, column[s] == T(0) ? T(0) : T(1) / column[s]);
  }
}

/// Inverse of the unit lower triangle of the pivot block [j, end), continued by the identity in the rows and columns of
/// the panel that are no pivots.
template <class T>
void invert_block(const Elimination<T>& f, std::int64_t j, std::int64_t end) {
  constexpr std::int64_t p = kPanel<T>;
  const Tag<T> tag;
  T* inverse = f.inverses + j * p;
  for (std::int64_t t = 0; t < p * p; ++t) inverse[t] = t % (p + 1) == 0 ? T(1) : T(0);
  for (std::int64_t s = 0; s < end - j; ++s) {
    const T* column = f.c + (j + s) * f.ld + j;
    for (std::int64_t t = 0; t <= s; ++t) {
      const Vector<T> factor = vn::Set(tag, inverse[t * p + s]);
      for (std::int64_t i = 0; i < p; i += kLanes<T>) {  // x_t -= L(below s, s) x_t(s)
        const auto below = vn::Gt(element_numbers<T>(i), vn::Set(RealTag<T>(), static_cast<Real<T>>(s)));
        const Vector<T> l = vn::IfThenElseZero(below, vn::LoadU(tag, column + i));
        T* x = inverse + t * p + i;
        vn::StoreU(vn::NegMulAdd(l, factor, vn::LoadU(tag, x)), tag, x);
      }
    }
  }
}

template <class T>
PivotCounts partial_getrf(std::int64_t m, std::int64_t k, T* c, std::int64_t ld, ZeroPivot<Real<T>> zero,
                          std::int32_t* perm, char* replaced) {
  constexpr std::int64_t p = kPanel<T>;
  const std::int64_t rows = padded<T>(k);
  T* memory = scratch<T>(
      rows * p + (rows * static_cast<std::int64_t>(sizeof(std::int64_t)) - 1) / static_cast<std::int64_t>(sizeof(T)) +
      1);
  Elimination<T> f{m, k, c, ld, zero, perm, replaced, memory, reinterpret_cast<std::int64_t*>(memory + rows * p)};
  for (std::int64_t j = 0; j < k; ++j) perm[j] = static_cast<std::int32_t>(j);
  for (std::int64_t j = 0; j < m; j += p) {
    const std::int64_t depth = std::min(j, k);
    exchange_rows(f, 0, depth, j, j + p);
    update_block_column(f, j, depth, std::min(j, rows));
    if (j >= k) continue;
    const std::int64_t end = std::min(k, j + p);
    factor_block_column(f, j, end);
    if (j + p < m) invert_block(f, j, end);  // for the block columns that follow
    exchange_rows(f, j, end, 0, j);
  }
  return f.counts;
}

template <class T>
PivotCounts getrf(std::int64_t n, T* c, std::int64_t ld, ZeroPivot<Real<T>> zero, std::int32_t* perm, char* replaced) {
  return partial_getrf(n, n, c, ld, zero, perm, replaced);
}

template <class T, bool>
void fill(Kernels<T>& table) {
  table.getrf = getrf<T>;
  table.partial_getrf = partial_getrf<T>;
}
}  // namespace lu
ESPALIER_FILL_KERNELS(lu)

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(lu)
#endif
