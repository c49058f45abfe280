#include "device/host/pivoting.hpp"

#include <cmath>

namespace espalier::device::host {

namespace {

template <class T>
void multiply_determinant(Index n, const T* d, const T* e, Determinant& determinant) {
  for (Index k = 0; k < n; ++k) {
    if (k + 1 < n && e[k] != T(0)) {
      determinant.multiply(static_cast<double>(pair_over_coupling(d[k], e[k], d[k + 1])));
      determinant.multiply(static_cast<double>(e[k]));
      ++k;
    } else {
      determinant.multiply(static_cast<double>(d[k]));
    }
  }
}

// Eigenvalues of the pivots of ldlt that are kept, but small.
template <class T>
void mark_small(NumericState<T>& s, const PivotBlock& block, const T* d, const T* e, const char* replaced,
                FrontOutcome& out) {
  const Index at = block.at, n = block.size;
  const auto judge = [&](Index k, double eigenvalue) {
    if (!(std::abs(eigenvalue) < s.rule.suspect)) return;
    s.column_state[at + s.pivot_order[at + k]] |= kColumnSmall;
    if (eigenvalue < 0) ++out.small_negative;
  };
  for (Index k = 0; k < n; ++k) {
    if (k + 1 < n && e[k] != T(0)) {
      const double a = d[k], b = e[k], c = d[k + 1];
      const double larger = (a + c) / 2 + std::copysign(std::hypot((a - c) / 2, b), a + c);
      judge(k, larger);
      judge(++k, (a * c - b * b) / larger);
    } else if (replaced[k] == 0) {
      judge(k, static_cast<double>(d[k]));
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
    invert_blocks(n, d, e, s.d_inverse.data() + at, s.e_inverse.data() + at);
    multiply_determinant(n, d, e, out.determinant);
    if (s.rule.suspect > 0) mark_small(s, block, d, e, replaced, out);
  } else {
    const bool judged = s.kind == Kind::llt && !s.rule.smallest.empty();
    for (Index k = 0; k < n; ++k) {
      const auto d = static_cast<double>(c[k * block.ld + k]);
      if (judged && d * d <= s.rule.smallest[static_cast<std::size_t>(at + k)])
        s.column_state[at + k] |= kColumnReplaced;
      if (s.kind == Kind::lu && std::abs(d) < s.rule.suspect && replaced[k] == 0)
        s.column_state[at + k] |= kColumnSmall;
      out.determinant.multiply(d);
      if (s.kind == Kind::llt) out.determinant.multiply(d);
    }
    if (s.kind == Kind::lu) out.determinant.multiply(permutation_sign(s.pivot_order.data() + at, n));
  }
  if (replaced == nullptr) return;
  for (Index k = 0; k < n; ++k) {
    if (replaced[k] == 0) continue;
    const Index row = at + s.pivot_order[at + k];
    if (s.kind == Kind::ldlt) {  // the unknown that the pivoting moved there
      s.column_state[row] |= kColumnReplaced;
      if (w.column[k] < T(0)) --out.negative;  // its sign means nothing
    } else {  // the column stayed where it was; the row that was left over for it had better leave as well
      s.column_state[at + k] |= kColumnReplaced;
      s.column_state[row] |= kColumnFailed;
    }
  }
}

template <class T>
void factor_diagonal(NumericState<T>& s, Workspace<T>& w, const PivotBlock& block, T* inverse, T* inverse2) {
  const Index at = block.at, n = block.size;
  const Offset ld = block.ld;
  T* c = w.c.data();
  char* replaced = w.marks.data();
  const auto tiny = static_cast<T>(s.rule.tiny);
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
    counts = s.dense.ldlt(n, c, ld, tiny, perm, w.column.data(), w.column.data() + n, replaced);
  } else {
    counts = s.dense.getrf(n, c, ld, tiny, perm, replaced);
    s.dense.invert_upper_transposed(n, c, ld, inverse2);
  }
  book_pivots(s, w, block, counts, replaced);
  s.dense.invert_lower(n, c, ld, true, inverse);
}

template <class T>
void mark_growth(NumericState<T>& s, Index at, Index n, const T* growth) {
  const T limit = static_cast<T>(1.0 / s.rule.threshold);
  for (Index k = 0; k < n; ++k)
    if (!(growth[k] <= limit)) {
      // Pivoting of lu exchanges rows, that of ldlt unknowns. Tiles of one block column are made by several workers.
      std::atomic_ref<char> state(s.column_state[at + (s.kind == Kind::lu ? k : s.pivot_order[at + k])]);
      state.fetch_or(kColumnFailed, std::memory_order_relaxed);
    }
}

template void book_pivots(NumericState<double>&, Workspace<double>&, const PivotBlock&, const PivotCounts&,
                          const char*);
template void book_pivots(NumericState<float>&, Workspace<float>&, const PivotBlock&, const PivotCounts&, const char*);
template void factor_diagonal(NumericState<double>&, Workspace<double>&, const PivotBlock&, double*, double*);
template void factor_diagonal(NumericState<float>&, Workspace<float>&, const PivotBlock&, float*, float*);
template void mark_growth(NumericState<double>&, Index, Index, const double*);
template void mark_growth(NumericState<float>&, Index, Index, const float*);

}  // namespace espalier::device::host
