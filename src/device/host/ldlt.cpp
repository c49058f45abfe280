/// \file
/// L D L^T with bounded Bunch-Kaufman (rook) pivoting of a diagonal tile and of a small front.
#include "device/host/kernel_parts.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "device/host/ldlt.cpp"
#include "hwy/foreach_target.h"  // must precede highway.h
// clang-format off: the order matters
#include "device/host/micro_kernel-inl.hpp"
#include "device/host/pivot_search-inl.hpp"
// clang-format on
#include <cmath>
#include <utility>

#include "device/host/scratch.hpp"

HWY_BEFORE_NAMESPACE();
namespace espalier::device::host::HWY_NAMESPACE {
namespace {

/// Columns that are eliminated before the trailing matrix is updated by a product.
inline constexpr std::int64_t kStep = 16;

/// A front under elimination. Within a panel of at most kStep + 1 columns that starts at `first`, the trailing matrix
/// is still the one from before the panel; column t of w holds column first + t of L D.
template <class T>
struct Elimination {
  std::int64_t m;  ///< rows
  std::int64_t k;  ///< rows among which pivots are chosen
  T* c;            ///< lower triangle, column-major
  std::int64_t ld;
  T tiny;
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
template <class T, int N>
HWY_INLINE void update_rows(const Elimination<T>& f, std::int64_t i, std::int64_t r, std::int64_t columns,
                            const T* source, T* target, const Range& range, Vector<T>& largest) {
  const Tag<T> tag;
  Vector<T> x[N];
  HWY_UNROLL(8)
  for (int v = 0; v < N; ++v) x[v] = hn::LoadU(tag, source + i + v * kLanes<T>);
  const T* l = f.c + f.first * f.ld + i;
  const T* w = f.w + r;
  for (std::int64_t s = 0; s < columns; ++s, l += f.ld, w += f.ldw) {
    const Vector<T> factor = hn::Set(tag, *w);
    HWY_UNROLL(8)
    for (int v = 0; v < N; ++v) x[v] = hn::NegMulAdd(hn::LoadU(tag, l + v * kLanes<T>), factor, x[v]);
  }
  const bool whole = range.covers(i, N * kLanes<T>);
  HWY_UNROLL(8)
  for (int v = 0; v < N; ++v) {
    hn::StoreU(x[v], tag, target + i + v * kLanes<T>);
    largest = hn::Max(largest, whole ? hn::Abs(x[v]) : magnitudes<T>(x[v], i + v * kLanes<T>, range));
  }
}

/// w(:, t) = the updated column r of the matrix that is left at step j (rows j..m; what stands above is undefined).
/// @returns the largest magnitude among the rows [j, k) other than r
template <class T>
T load_column(const Elimination<T>& f, std::int64_t j, std::int64_t r, std::int64_t t) {
  T* target = f.w + t * f.ldw;
  const T* source = f.c + r * f.ld;
  if (r != j) {
    for (std::int64_t i = j; i < r; ++i) target[i] = f.c[i * f.ld + r];
    std::copy(source + r, source + f.m, target + r);
    source = target;
  }
  const Range range{j, f.k, r};
  const std::int64_t columns = j - f.first;
  Vector<T> largest = hn::Zero(Tag<T>());
  std::int64_t i = j / kPanel<T> * kPanel<T>;
  for (; i + 7 * kLanes<T> < f.m; i += 8 * kLanes<T>)
    update_rows<T, 8>(f, i, r, columns, source, target, range, largest);
  for (; i + 3 * kLanes<T> < f.m; i += 4 * kLanes<T>)
    update_rows<T, 4>(f, i, r, columns, source, target, range, largest);
  for (; i < f.m; i += kLanes<T>) update_rows<T, 1>(f, i, r, columns, source, target, range, largest);
  return hn::GetLane(hn::MaxOfLanes(Tag<T>(), largest));
}

/// Rook search (Ashcraft, Grimes, Lewis 1998, SIAM J. Matrix Anal. 20, section 2.4) at step j; alpha balances the
/// growth of one 2x2 against two 1x1 steps (Bunch and Kaufman 1977).
template <class T>
Choice choose_pivot(const Elimination<T>& f, std::int64_t j) {
  const T alpha = T(0.6403882032022076);  // (1 + sqrt(17)) / 8
  const std::int64_t t = j - f.first;
  T* here = f.w + t * f.ldw;
  T* there = here + f.ldw;
  T column_largest = load_column(f, j, j, t);
  // NaN fails every comparison below and thus ends the search at once
  if (!(std::abs(here[j]) < alpha * column_largest) || !(column_largest >= f.tiny)) return {j, -1};
  std::int64_t p = j, q = find_row(here, column_largest, {j, f.k, j});
  for (std::int64_t round = j; round < f.k && q != p; ++round) {
    const T row_largest = load_column(f, j, q, t + 1);
    if (!(std::abs(there[q]) < alpha * row_largest)) {
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
template <class T>
void exchange(Elimination<T>& f, std::int64_t a, std::int64_t b, std::int64_t columns) {
  if (a == b) return;
  if (a > b) std::swap(a, b);
  T* c = f.c;
  for (std::int64_t s = 0; s < a; ++s) std::swap(c[s * f.ld + a], c[s * f.ld + b]);
  std::swap(c[a * f.ld + a], c[b * f.ld + b]);
  for (std::int64_t i = a + 1; i < b; ++i) std::swap(c[a * f.ld + i], c[i * f.ld + b]);
  for (std::int64_t i = b + 1; i < f.m; ++i) std::swap(c[a * f.ld + i], c[b * f.ld + i]);
  for (std::int64_t s = 0; s < columns; ++s) std::swap(f.w[s * f.ldw + a], f.w[s * f.ldw + b]);
  std::swap(f.perm[a], f.perm[b]);
}

/// Column j of L and the 1x1 pivot there.
template <class T>
void eliminate_one(Elimination<T>& f, std::int64_t j) {
  const T* w = f.w + (j - f.first) * f.ldw;
  T pivot = w[j];
  f.replaced[j] = std::abs(pivot) < f.tiny || pivot == T(0) ? 1 : 0;
  if (f.replaced[j] != 0) {
    pivot = std::copysign(f.tiny, pivot);
    ++f.counts.perturbed;
  }
  f.counts.negative += pivot < T(0) ? 1 : 0;
  f.d[j] = pivot;
  f.e[j] = T(0);
  const Tag<T> tag;
  const Vector<T> inverse = hn::Set(tag, pivot == T(0) ? T(0) : T(1) / pivot);
  T* l = f.c + j * f.ld;
  for (std::int64_t i = j / kPanel<T> * kPanel<T>; i < f.m; i += kLanes<T>)
    hn::StoreU(hn::Mul(hn::LoadU(tag, w + i), inverse), tag, l + i);
}

/// Columns j and j + 1 of L and the 2x2 pivot there: L = W D^-1, with D scaled by its off-diagonal entry.
template <class T>
void eliminate_two(Elimination<T>& f, std::int64_t j) {
  const T* w0 = f.w + (j - f.first) * f.ldw;
  const T* w1 = w0 + f.ldw;
  const T off = w0[j + 1], d0 = w0[j] / off, d1 = w1[j + 1] / off;
  const T scale = T(1) / ((d0 * d1 - T(1)) * off);
  f.d[j] = w0[j];
  f.d[j + 1] = w1[j + 1];
  f.e[j] = off;
  f.e[j + 1] = T(0);
  f.replaced[j] = f.replaced[j + 1] = 0;
  ++f.counts.two_by_two;
  // det D = off^2 (d0 d1 - 1): one eigenvalue of each sign when negative, else both have the sign of the trace
  f.counts.negative += d0 * d1 < T(1) ? 1 : (f.d[j] < T(0) ? 2 : 0);
  T* l0 = f.c + j * f.ld;
  T* l1 = l0 + f.ld;
  const Tag<T> tag;
  const Vector<T> v0 = hn::Set(tag, d0), v1 = hn::Set(tag, d1), factor = hn::Set(tag, scale);
  for (std::int64_t i = j / kPanel<T> * kPanel<T>; i < f.m; i += kLanes<T>) {
    const Vector<T> x0 = hn::LoadU(tag, w0 + i), x1 = hn::LoadU(tag, w1 + i);
    hn::StoreU(hn::Mul(hn::MulSub(v1, x0, x1), factor), tag, l0 + i);
    hn::StoreU(hn::Mul(hn::MulSub(v0, x1, x0), factor), tag, l1 + i);
  }
  l0[j + 1] = T(0);
}

/// Eliminates up to kStep + 1 columns from `f.first` on. @returns the column after the last one eliminated
template <class T>
std::int64_t eliminate_panel(Elimination<T>& f) {
  std::int64_t j = f.first;
  while (j < f.k && j - f.first < kStep) {
    const Choice choice = choose_pivot(f, j);
    const std::int64_t columns = j - f.first + 1;
    if (choice.b < 0) {
      exchange(f, j, choice.a, columns);
      eliminate_one(f, j);
      ++j;
      continue;
    }
    exchange(f, j, choice.a, columns + 1);
    const std::int64_t second = choice.b == j ? choice.a : choice.b;  // j moved away when it was the second itself
    exchange(f, j + 1, second, columns + 1);
    eliminate_two(f, j);
    j += 2;
  }
  return j;
}

template <class T>
PivotCounts partial_ldlt(std::int64_t m, std::int64_t k, T* c, std::int64_t ld, T tiny, std::int32_t* perm, T* d, T* e,
                         char* replaced) {
  const std::int64_t ldw = padded<T>(m);
  Elimination<T> f{m, k, c, ld, tiny, perm, d, e, replaced, scratch<T>(ldw * (kStep + 2)), ldw};
  for (std::int64_t j = 0; j < k; ++j) perm[j] = static_cast<std::int32_t>(j);
  while (f.first < k) {
    const std::int64_t next = eliminate_panel(f);
    const T *left = c + f.first * ld, *right = f.w;
    lower_product<T>(m, next, m, next - f.first, scratch_of<T>(left, ld), scratch_of<T>(right, ldw), scratch_of(c, ld));
    f.first = next;
  }
  return f.counts;
}

template <class T>
PivotCounts ldlt(std::int64_t n, T* c, std::int64_t ld, T tiny, std::int32_t* perm, T* d, T* e, char* replaced) {
  return partial_ldlt(n, n, c, ld, tiny, perm, d, e, replaced);
}

template <class T>
void fill(Kernels<T>& table) {
  table.ldlt = ldlt<T>;
  table.partial_ldlt = partial_ldlt<T>;
}
void fill_double(Kernels<double>& table) { fill(table); }
void fill_float(Kernels<float>& table) { fill(table); }

}  // namespace
}  // namespace espalier::device::host::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
ESPALIER_KERNEL_PART(fill_ldlt)
#endif
