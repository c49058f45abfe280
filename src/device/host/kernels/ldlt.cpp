/// \file
/// L D L^T, of Hermitian tiles (kConjugate) L D L^H, with bounded Bunch-Kaufman (rook) pivoting of a diagonal tile and
/// of a small front.
#include "device/host/kernels/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/kernels/ldlt.cpp"
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
namespace ldlt {

/// Columns that are eliminated before the trailing matrix is updated by a product.
inline constexpr std::int64_t kStep = 16;

/// Whether the eigenvalues of D are real.
template <class T, bool kConjugate>
inline constexpr bool kHasSigns = kConjugate || !kComplex<T>;

/// A front under elimination. Within a panel of at most kStep + 1 columns that starts at `first`, the trailing matrix
/// is still the one from before the panel; column t of w holds column first + t of L D.
template <class T>
struct Elimination {
  std::int64_t m;  ///< rows
  std::int64_t k;  ///< rows among which pivots are chosen
  T* c;            ///< lower triangle, column-major
  std::int64_t ld;
  ZeroPivot<Real<T>> zero;
  std::int32_t* perm;
  T* d;
  T* e;
  char* replaced;
  T* w;  ///< ldw x (kStep + 2)
  std::int64_t ldw;
  std::int64_t first = 0;
  PivotCounts counts = {};
};

/// What the search decided: pivot on (a, a), or on the pair (a, b), given in current positions; the updated columns
/// stand in w at t and t + 1.
struct Choice {
  std::int64_t a;
  std::int64_t b;  ///< < 0 for a 1x1 pivot
};

/// N vectors from row i on of w(:, t) = source - L(:, panel) w(r, panel)^T; `largest` takes in their magnitudes.
template <class T, bool kConjugate, int N>
HWY_INLINE void update_rows(const Elimination<T>& f, std::int64_t i, std::int64_t r, std::int64_t columns,
                            const T* source, T* target, const Range& range, RealVector<T>& largest) {
  const Tag<T> tag;
  ProductSum<T, kConjugate> sum[N];
  HWY_UNROLL(8)
  for (int v = 0; v < N; ++v) sum[v].start(vn::LoadU(tag, source + i + v * kLanes<T>));
  const T* l = f.c + f.first * f.ld + i;
  const T* w = f.w + r;
  for (std::int64_t s = 0; s < columns; ++s, l += f.ld, w += f.ldw) {
    const Multiplier<T> factor(w);
    HWY_UNROLL(8)
    for (int v = 0; v < N; ++v) sum[v].template take<false>(vn::LoadU(tag, l + v * kLanes<T>), factor);
  }
  Vector<T> x[N];
  HWY_UNROLL(8)
  for (int v = 0; v < N; ++v) x[v] = sum[v].total();
  const bool whole = range.covers(i, N * kLanes<T>);
  HWY_UNROLL(8)
  for (int v = 0; v < N; ++v) {
    vn::StoreU(x[v], tag, target + i + v * kLanes<T>);
    largest = vn::Max(largest, whole ? magnitude_of<T>(x[v]) : magnitudes<T>(x[v], i + v * kLanes<T>, range));
  }
}

/// w(:, t) = the updated column r of the matrix that is left at step j (rows j..m; what stands above is undefined).
/// @returns the largest magnitude among the rows [j, k) other than r
template <class T, bool kConjugate>
Real<T> load_column(const Elimination<T>& f, std::int64_t j, std::int64_t r, std::int64_t t) {
  T* target = f.w + t * f.ldw;
  const T* source = f.c + r * f.ld;
  if (r != j) {
    for (std::int64_t i = j; i < r; ++i) target[i] = conjugate<kConjugate>(f.c[i * f.ld + r]);
    std::copy(source + r, source + f.m, target + r);
    source = target;
  }
  const Range range{j, f.k, r};
  const std::int64_t columns = j - f.first;
  RealVector<T> largest = vn::Zero(RealTag<T>());
  std::int64_t i = j / kPanel<T> * kPanel<T>;
  for (; i + 7 * kLanes<T> < f.m; i += 8 * kLanes<T>)
    update_rows<T, kConjugate, 8>(f, i, r, columns, source, target, range, largest);
  for (; i + 3 * kLanes<T> < f.m; i += 4 * kLanes<T>)
    update_rows<T, kConjugate, 4>(f, i, r, columns, source, target, range, largest);
  for (; i < f.m; i += kLanes<T>) update_rows<T, kConjugate, 1>(f, i, r, columns, source, target, range, largest);
  return vn::GetLane(vn::MaxOfLanes(RealTag<T>(), largest));
}

/// Rook search (Ashcraft, Grimes, Lewis 1998, SIAM J. Matrix Anal. 20, section 2.4) at step j; alpha balances the
/// growth of one 2x2 against two 1x1 steps (Bunch and Kaufman 1977).
template <class T, bool kConjugate>
Choice choose_pivot(const Elimination<T>& f, std::int64_t j) {
  const Real<T> alpha = Real<T>(0.6403882032022076);  // (1 + sqrt(17)) / 8
  const std::int64_t t = j - f.first;
  T* here = f.w + t * f.ldw;
  T* there = here + f.ldw;
  Real<T> column_largest = load_column<T, kConjugate>(f, j, j, t);
  // NaN fails every comparison below and thus ends the search at once
  if (!(magnitude_of(here[j]) < alpha * column_largest) || !(column_largest >= f.zero.below)) return {j, -1};
  std::int64_t p = j, q = find_row(here, column_largest, {j, f.k, j});
  for (std::int64_t round = j; round < f.k && q != p; ++round) {
    const Real<T> row_largest = load_column<T, kConjugate>(f, j, q, t + 1);
    if (!(magnitude_of(there[q]) < alpha * row_largest)) {
      std::copy(there + j, there + f.m, here + j);
      return {q, -1};
    }
    const std::int64_t r = find_row(there, row_largest, {j, f.k, q});
    if (r == p || r == q || !(row_largest > column_largest)) break;
    std::copy(there + j, there + f.m, here + j);
    p = q;
    q = r;
    column_largest = row_largest;
  }
  return q == p ? Choice{j, -1} : Choice{p, q};
}

/// Exchanges rows and columns a < b of the whole front; the rows of w in its first `columns` columns follow.
template <class T, bool kConjugate>
void exchange(Elimination<T>& f, std::int64_t a, std::int64_t b, std::int64_t columns) {
  if (a == b) return;
  if (a > b) std::swap(a, b);
  T* c = f.c;
  for (std::int64_t s = 0; s < a; ++s) std::swap(c[s * f.ld + a], c[s * f.ld + b]);
  std::swap(c[a * f.ld + a], c[b * f.ld + b]);
  for (std::int64_t i = a + 1; i < b; ++i) {
    const T crossed = conjugate<kConjugate>(c[a * f.ld + i]);
    c[a * f.ld + i] = conjugate<kConjugate>(c[i * f.ld + b]);
    c[i * f.ld + b] = crossed;
  }
  c[a * f.ld + b] = conjugate<kConjugate>(c[a * f.ld + b]);
  for (std::int64_t i = b + 1; i < f.m; ++i) std::swap(c[a * f.ld + i], c[b * f.ld + i]);
  for (std::int64_t s = 0; s < columns; ++s) std::swap(f.w[s * f.ldw + a], f.w[s * f.ldw + b]);
  std::swap(f.perm[a], f.perm[b]);
}

/// Column j of L and the 1x1 pivot there.
template <class T, bool kConjugate>
void eliminate_one(Elimination<T>& f, std::int64_t j) {
  const T* w = f.w + (j - f.first) * f.ldw;
  T pivot = w[j];
  if constexpr (kConjugate) pivot = real_of(pivot);
  f.replaced[j] = magnitude_of(pivot) < f.zero.below || pivot == T(0) ? 1 : 0;
  if (f.replaced[j] != 0) {
    pivot = replacement(f.zero.instead, pivot);
    ++f.counts.perturbed;
  }
  f.counts.negative += kHasSigns<T, kConjugate> && real_of(pivot) < Real<T>(0) ? 1 : 0;
  f.d[j] = pivot;
  f.e[j] = T(0);
  const Tag<T> tag;
  const Vector<T> inverse = vn::Set(tag, pivot == T(0) ? T(0) : T(1) / pivot);
  T* l = f.c + j * f.ld;
  for (std::int64_t i = j / kPanel<T> * kPanel<T>; i < f.m; i += kLanes<T>)
    vn::StoreU(vn::Mul(vn::LoadU(tag, w + i), inverse), tag, l + i);
}

/// D^-1 = [d1 -above; -below d0] / scale of a 2x2 pivot whose parts are measured in its off-diagonal entry: as it is
/// (symmetric; above = below = 1), or in its magnitude (Hermitian; above is the direction of the entry itself, for L D
/// D^-1 works on columns).
template <class T>
struct PairInverse {
  T d0, d1, above, below, scale;
};
template <class T, bool kConjugate>
PairInverse<T> invert_pair(T a, T off, T c) {
  if constexpr (kConjugate) {
    const Real<T> size = std::abs(off), d0 = real_of(a) / size, d1 = real_of(c) / size;
    return {d0, d1, off / size, conjugate<true>(off) / size, Real<T>(1) / ((d0 * d1 - Real<T>(1)) * size)};
  } else {
    const T d0 = a / off, d1 = c / off;
    return {d0, d1, T(1), T(1), T(1) / ((d0 * d1 - T(1)) * off)};
  }
}

/// Columns j and j + 1 of L and the 2x2 pivot there: L = W D^-1, with D scaled by its off-diagonal entry.
template <class T, bool kConjugate>
void eliminate_two(Elimination<T>& f, std::int64_t j) {
  const T* w0 = f.w + (j - f.first) * f.ldw;
  const T* w1 = w0 + f.ldw;
  f.d[j] = w0[j];
  f.d[j + 1] = w1[j + 1];
  if constexpr (kConjugate) {
    f.d[j] = real_of(w0[j]);
    f.d[j + 1] = real_of(w1[j + 1]);
  }
  f.e[j] = w0[j + 1];
  f.e[j + 1] = T(0);
  const PairInverse<T> pair = invert_pair<T, kConjugate>(f.d[j], f.e[j], f.d[j + 1]);
  f.replaced[j] = f.replaced[j + 1] = 0;
  ++f.counts.two_by_two;
  // det D = off^2 (d0 d1 - 1): one eigenvalue of each sign when negative, else both have the sign of the trace
  if constexpr (kHasSigns<T, kConjugate>)
    f.counts.negative += real_of(pair.d0 * pair.d1) < Real<T>(1) ? 1 : (real_of(f.d[j]) < Real<T>(0) ? 2 : 0);
  T* l0 = f.c + j * f.ld;
  T* l1 = l0 + f.ld;
  const Tag<T> tag;
  const Vector<T> v0 = vn::Set(tag, pair.d0), v1 = vn::Set(tag, pair.d1), factor = vn::Set(tag, pair.scale);
  const Vector<T> above = vn::Set(tag, pair.above), below = vn::Set(tag, pair.below);
  for (std::int64_t i = j / kPanel<T> * kPanel<T>; i < f.m; i += kLanes<T>) {
    const Vector<T> x0 = vn::LoadU(tag, w0 + i), x1 = vn::LoadU(tag, w1 + i);
    const Vector<T> y0 = kConjugate ? vn::Mul(x0, below) : x0, y1 = kConjugate ? vn::Mul(x1, above) : x1;
    vn::StoreU(vn::Mul(vn::MulSub(v1, x0, y1), factor), tag, l0 + i);
    vn::StoreU(vn::Mul(vn::MulSub(v0, x1, y0), factor), tag, l1 + i);
  }
  l0[j + 1] = T(0);
}

/// Eliminates up to kStep + 1 columns from `f.first` on. @returns the column after the last one eliminated
template <class T, bool kConjugate>
std::int64_t eliminate_panel(Elimination<T>& f) {
  std::int64_t j = f.first;
  while (j < f.k && j - f.first < kStep) {
    const Choice choice = choose_pivot<T, kConjugate>(f, j);
    const std::int64_t columns = j - f.first + 1;
    if (choice.b < 0) {
      exchange<T, kConjugate>(f, j, choice.a, columns);
      eliminate_one<T, kConjugate>(f, j);
      ++j;
      continue;
    }
    exchange<T, kConjugate>(f, j, choice.a, columns + 1);
    const std::int64_t second = choice.b == j ? choice.a : choice.b;  // j moved away when it was the second itself
    exchange<T, kConjugate>(f, j + 1, second, columns + 1);
    eliminate_two<T, kConjugate>(f, j);
    j += 2;
  }
  return j;
}

template <class T, bool kConjugate>
PivotCounts partial_ldlt(std::int64_t m, std::int64_t k, T* c, std::int64_t ld, ZeroPivot<Real<T>> zero,
                         std::int32_t* perm, T* d, T* e, char* replaced) {
  const std::int64_t ldw = padded<T>(m);
  Elimination<T> f{m, k, c, ld, zero, perm, d, e, replaced, scratch<T>(ldw * (kStep + 2)), ldw};
  for (std::int64_t j = 0; j < k; ++j) perm[j] = static_cast<std::int32_t>(j);
  while (f.first < k) {
    const std::int64_t next = eliminate_panel<T, kConjugate>(f);
    const T *left = c + f.first * ld, *right = f.w;
    lower_product<T, kConjugate>(m, next, m, next - f.first, scratch_of<T>(left, ld), scratch_of<T>(right, ldw),
                                 scratch_of(c, ld));
    f.first = next;
  }
  return f.counts;
}

template <class T, bool kConjugate>
PivotCounts ldlt(std::int64_t n, T* c, std::int64_t ld, ZeroPivot<Real<T>> zero, std::int32_t* perm, T* d, T* e,
                 char* replaced) {
  return partial_ldlt<T, kConjugate>(n, n, c, ld, zero, perm, d, e, replaced);
}

template <class T, bool kConjugate>
void fill(Kernels<T>& table) {
  table.ldlt = ldlt<T, kConjugate>;
  table.partial_ldlt = partial_ldlt<T, kConjugate>;
}
}  // namespace ldlt
ESPALIER_FILL_KERNELS(ldlt)

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(ldlt)
#endif
