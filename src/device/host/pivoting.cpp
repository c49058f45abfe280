#include "device/host/pivoting.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::device::host {

namespace {

template <class T>
void multiply_determinant(Index n, const T* d, const T* e, bool hermitian, Determinant& determinant) {
  for (Index k = 0; k < n; ++k) {
    if (k + 1 < n && e[k] != T(0)) {
      const T coupled =
          hermitian ? hermitian_pair_over_coupling(d[k], e[k], d[k + 1]) : pair_over_coupling(d[k], e[k], d[k + 1]);
      determinant.multiply(static_cast<WideOf<T>>(coupled));
      determinant.multiply(static_cast<WideOf<T>>(hermitian ? T(std::abs(e[k])) : e[k]));
      ++k;
    } else {
      determinant.multiply(static_cast<WideOf<T>>(d[k]));
    }
  }
}

// The eigenvalues of a 2x2 pivot by their magnitudes, the larger one first; of a complex symmetric one, whose signs
// mean nothing, their magnitudes.
struct PairEigenvalues {
  double larger, smaller;
};
template <class T>
PairEigenvalues eigenvalues(T first, T coupling, T second, bool hermitian) {
  if (base::ScalarTraits<T>::is_complex && !hermitian) {
    const auto a = static_cast<WideOf<T>>(first), b = static_cast<WideOf<T>>(coupling),
               c = static_cast<WideOf<T>>(second);
    const WideOf<T> root = std::sqrt((a - c) * (a - c) / 4.0 + b * b), middle = (a + c) / 2.0;
    const double larger = std::max(std::abs(middle + root), std::abs(middle - root));
    return {larger, std::abs(a * c - b * b) / larger};
  }
  const double a = std::real(first), b = std::abs(coupling), c = std::real(second);
  const double larger = (a + c) / 2 + std::copysign(std::hypot((a - c) / 2, b), a + c);
  return {larger, (a * c - b * b) / larger};
}

void note_pivot(FrontOutcome& out, double magnitude) {
  if (!(magnitude >= out.least_pivot)) out.least_pivot = magnitude > 0 ? magnitude : 0;  // not a number: 0
}

// Eigenvalues of the pivots of ldlt that are kept, but small.
template <class T>
void mark_small(NumericState<T>& s, const PivotBlock& block, const T* d, const T* e, const char* replaced,
                FrontOutcome& out) {
  const Index at = block.at, n = block.size;
  const auto judge = [&](Index k, double eigenvalue) {
    note_pivot(out, std::abs(eigenvalue));
    if (!(std::abs(eigenvalue) < s.rule.suspect)) return;
    s.column_state[at + s.pivot_order[at + k]] |= kColumnSmall;
    if (eigenvalue < 0) ++out.small_negative;
  };
  for (Index k = 0; k < n; ++k) {
    if (k + 1 < n && e[k] != T(0)) {
      const PairEigenvalues pair = eigenvalues(d[k], e[k], d[k + 1], s.hermitian);
      judge(k, pair.larger);
      judge(++k, pair.smaller);
    } else if (replaced[k] == 0) {
      judge(k, base::ScalarTraits<T>::is_complex && !s.hermitian ? std::abs(d[k]) : std::real(d[k]));
    }
  }
}

// Sign of a permutation: each cycle of even length flips it. Visited entries are marked by their complement and
// restored.
double permutation_sign(std::int32_t* perm, Index n) {
  double sign = -1;
  for (Index k = 0; k < n; ++k) {
    if (perm[k] < 0) continue;
    for (Index q = k; perm[q] >= 0;) {
      const Index next = perm[q];
      perm[q] = ~next;
      q = next;
      sign = -sign;
    }
    sign = -sign;  // a cycle of m entries is m - 1 exchanges
  }
  for (Index k = 0; k < n; ++k) perm[k] = ~perm[k];
  return -sign;
}

}  // namespace

template <class T>
void book_pivots(NumericState<T>& s, Workspace<T>& w, const PivotBlock& block, const PivotCounts& counts,
                 const char* replaced) {
  const Index at = block.at, n = block.size;
  const T* c = w.c.data();
  FrontOutcome& out = s.fronts[block.front];
  out.two_by_two += counts.two_by_two;
  out.negative += counts.negative;
  if (s.kind == Kind::ldlt) {
    const T *d = w.column.data(), *e = d + n;
    invert_blocks(n, d, e, s.d_inverse.data() + at, s.e_inverse.data() + at, s.hermitian);
    multiply_determinant(n, d, e, s.hermitian, out.determinant);
    if (s.rule.suspect > 0)
      mark_small(s, block, d, e, replaced, out);
    else
      out.least_pivot = 0;
  } else {
    const bool judged = s.kind == Kind::llt && !s.rule.smallest.empty();
    for (Index k = 0; k < n; ++k) {
      const auto d = static_cast<WideOf<T>>(c[k * block.ld + k]);
      if (judged && std::real(d) * std::real(d) <= s.rule.smallest[static_cast<std::size_t>(at + k)])
        s.column_state[at + k] |= kColumnReplaced;
      if (s.kind == Kind::lu) note_pivot(out, std::abs(d));
      if (s.kind == Kind::lu && std::abs(d) < s.rule.suspect && replaced[k] == 0)
        s.column_state[at + k] |= kColumnSmall;
      out.determinant.multiply(d);
      if (s.kind == Kind::llt) out.determinant.multiply(d);
    }
    if (s.kind == Kind::lu) out.determinant.multiply(permutation_sign(s.pivot_order.data() + at, n));
  }
  if (replaced == nullptr) return;
  const bool has_signs = s.hermitian || !base::ScalarTraits<T>::is_complex;
  for (Index k = 0; k < n; ++k) {
    if (replaced[k] == 0) continue;
    const Index row = at + s.pivot_order[at + k];
    if (s.kind == Kind::ldlt) {  // the unknown that the pivoting moved there
      s.column_state[row] |= kColumnReplaced;
      if (has_signs && std::real(w.column[k]) < 0) --out.negative;  // its sign means nothing
    } else {  // the column stayed where it was; the row that was left over for it had better leave as well
      s.column_state[at + k] |= kColumnReplaced;
      s.column_state[row] |= s.rule.in_place_of_zero > 0 ? kRowReplaced : kColumnFailed;
    }
  }
}

namespace {

// What is left of a column that depends on others is rounding error; what exceeds this is none.
double largest_zero(const PivotRule& rule) {
  constexpr double kRounding = 4;  // pivots below `tiny` are zeros; a column is as long as the matrix is high
  return kRounding * rule.tiny;
}

}  // namespace

template <class T>
void factor_diagonal(NumericState<T>& s, Workspace<T>& w, const PivotBlock& block, T* inverse, T* inverse2) {
  const Index at = block.at, n = block.size;
  const Offset ld = block.ld;
  T* c = w.c.data();
  char* replaced = w.marks.data();
  const auto zero = zero_pivot<T>(s.rule);
  PivotCounts counts;
  if (s.kind == Kind::llt) {
    const auto good = static_cast<Index>(s.dense.potrf(n, c, ld));
    FrontOutcome& out = s.fronts[block.front];
    if (good < n && out.not_positive < 0) out.not_positive = at + good;
    book_pivots(s, w, block, counts, nullptr);
    s.dense.invert_lower(n, c, ld, false, inverse);
    return;
  }
  std::int32_t* perm = s.pivot_order.data() + at;
  if (s.kind == Kind::ldlt) {
    counts = s.dense.ldlt(n, c, ld, zero, perm, w.column.data(), w.column.data() + n, replaced);
  } else {
    counts = s.dense.getrf(n, c, ld, zero, perm, replaced);
  }
  if (s.kind == Kind::lu) s.dense.invert_upper_transposed(n, c, ld, inverse2);
  book_pivots(s, w, block, counts, replaced);
  s.dense.invert_lower(n, c, ld, true, inverse);
  mark_rows_inside(s, w, block, n);
}

template <class T>
void add_growth(const NumericState<T>& s, Index rows, Index cols, const T* panels, RealOf<T>* growth) {
  constexpr Index p = kPanel<T>;
  const Index whole = rows / p * p;
  s.dense.column_max(whole, cols, panels, growth);
  const T* last = panels + Offset{whole} * cols;
  for (Index j = 0; j < cols; ++j)
    for (Index r = 0; r < rows - whole; ++r)
      if (const RealOf<T> magnitude = std::abs(last[j * p + r]); !(magnitude <= growth[j])) growth[j] = magnitude;
}

template <class T>
void mark_growth(NumericState<T>& s, Index at, Index n, const RealOf<T>* growth) {
  const auto limit = static_cast<RealOf<T>>(1.0 / s.rule.threshold);
  const bool parts = s.rule.in_place_of_zero > 0;
  const auto of_zero = static_cast<RealOf<T>>(parts ? largest_zero(s.rule) / s.rule.in_place_of_zero : 0);
  for (Index k = 0; k < n; ++k) {
    if (growth[k] <= (parts ? of_zero : limit)) continue;
    // Pivoting of lu exchanges rows, that of ldlt unknowns. Tiles of one block column are made by several workers.
    std::atomic_ref<char> state(s.column_state[at + (s.kind == Kind::lu ? k : s.pivot_order[at + k])]);
    const bool replaced = parts && (state.load(std::memory_order_relaxed) & kColumnReplaced) != 0;
    if (replaced || !(growth[k] <= limit)) state.fetch_or(kColumnFailed, std::memory_order_relaxed);
  }
}

template <class T>
bool has_parted(const NumericState<T>& s, Index at, Index n) {
  if (!(s.rule.in_place_of_zero > 0)) return false;
  for (Index k = 0; k < n; ++k) {
    std::atomic_ref<char> state(const_cast<char&>(s.column_state[at + k]));
    if ((state.load(std::memory_order_relaxed) & kColumnReplaced) != 0) return true;
  }
  return false;
}

template <class T>
void mark_rows(NumericState<T>& s, Index at, Index n, const RealOf<T>* growth) {
  const auto of_zero = static_cast<RealOf<T>>(largest_zero(s.rule));
  for (Index k = 0; k < n; ++k) {
    if (growth[k] <= of_zero) continue;
    std::atomic_ref<char> state(s.column_state[at + k]);
    if ((state.load(std::memory_order_relaxed) & kColumnReplaced) != 0)
      state.fetch_or(kColumnFailed, std::memory_order_relaxed);
  }
}

template <class T>
void mark_rows_inside(NumericState<T>& s, Workspace<T>& w, const PivotBlock& block, Index columns) {
  if (s.kind != Kind::lu || !has_parted(s, block.at, block.size)) return;
  std::fill_n(w.growth(), block.size, RealOf<T>(0));
  for (Index k = 0; k < block.size; ++k)
    for (Index j = k + 1; j < columns; ++j)
      if (const RealOf<T> u = std::abs(w.c[Offset{j} * block.ld + k]); !(u <= w.growth()[k])) w.growth()[k] = u;
  mark_rows(s, block.at, block.size, w.growth());
}

#define ESPALIER_INSTANTIATE(T)                                                                                   \
  template void book_pivots(NumericState<T>&, Workspace<T>&, const PivotBlock&, const PivotCounts&, const char*); \
  template void factor_diagonal(NumericState<T>&, Workspace<T>&, const PivotBlock&, T*, T*);                      \
  template void add_growth(const NumericState<T>&, Index, Index, const T*, RealOf<T>*);                           \
  template void mark_growth(NumericState<T>&, Index, Index, const RealOf<T>*);                                    \
  template bool has_parted(const NumericState<T>&, Index, Index);                                                 \
  template void mark_rows(NumericState<T>&, Index, Index, const RealOf<T>*);                                      \
  template void mark_rows_inside(NumericState<T>&, Workspace<T>&, const PivotBlock&, Index);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
