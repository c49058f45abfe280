#include "device/host/inverse_front.hpp"

#include <algorithm>
#include <cstring>

namespace espalier::device::host {

namespace {

template <class T>
void clear_tile(T* c, Offset ld, Index cols) {
  std::memset(static_cast<void*>(c), 0, static_cast<std::size_t>(ld * cols) * sizeof(T));
}

}  // namespace

// Panels of C^T; of Hermitian matrices C^H, as the products take it.
template <class T>
void InverseFront<T>::pack_across(Index rows, Index cols, const T* c, T* panels) const {
  s_.dense.pack_transposed(rows, cols, c, padded<T>(rows), panels);
  if constexpr (base::ScalarTraits<T>::is_complex) {
    if (!s_.hermitian) return;
    const Offset size = padded<T>(cols) * rows;
    for (Offset k = 0; k < size; ++k) panels[k] = std::conj(panels[k]);
  }
}

template <class T>
void InverseFront<T>::negate_into(const T* from, T* to, Index n) const {
  const Offset size = padded<T>(n) * n;
  for (Offset k = 0; k < size; ++k) to[k] = -from[k];
}

// Column-major scratch gets the tile (i, k) below the pivots: for columns of one tile of the parent after another, rows
// that are neighbours in one of its panels together.
template <class T>
void InverseFront<T>::copy_from_parent(const FrontInverse<T>& parent, Index i, Index k, const T* from,
                                       InverseScratch<T>& w) const {
  const plan::FrontLayout& p = *parent.layout;
  const Index* places = s_.plan.places_in_parent(f_);
  const Index* rows = places + (l_.begin(i) - l_.pivots);
  const Index* cols = places + (l_.begin(k) - l_.pivots);
  const Index m = l_.width(i), n = l_.width(k), panel = p.panel;
  const Offset ld = padded<T>(m);
  for (Index c = 0, next = 0; c < n; c = next) {
    const Index tile_col = p.tile_of(cols[c]), begin = p.begin(tile_col), width = p.width(tile_col);
    for (next = c; next < n && cols[next] < begin + width;) ++next;
    for (Index r = 0, end = 0; r < m; r = end) {
      const Index tile_row = p.tile_of(rows[r]), first = rows[r] - p.begin(tile_row);
      const Index most = std::min(panel - first % panel, p.width(tile_row) - first);
      for (end = r + 1; end < m && end - r < most && rows[end] == rows[r] + (end - r);) ++end;
      const T* at = from + parent.tile(tile_row, tile_col) + Offset{first / panel} * panel * width + first % panel;
      for (Index q = c; q < next; ++q) {
        const T* column = at + Offset{cols[q] - begin} * panel;
        T* to = w.c.data() + q * ld;
        for (Index t = r; t < end; ++t) to[t] = column[t - r];
      }
    }
  }
}

template <class T>
void InverseFront<T>::take_from_parent(const FrontInverse<T>& parent, Index i, InverseScratch<T>& w) {
  for (Index k = l_.pivot_tiles; k < l_.tiles; ++k) {
    const Index m = l_.width(i), n = l_.width(k);
    copy_from_parent(parent, i, k, parent.z, w);
    s_.dense.pack(m, n, w.c.data(), padded<T>(m), inverse_.z + inverse_.tile(i, k));
    if (s_.kind != Kind::lu) continue;
    copy_from_parent(parent, i, k, parent.across, w);
    s_.dense.pack(m, n, w.c.data(), padded<T>(m), inverse_.across + inverse_.tile(i, k));
  }
}

// The factor holds W = L_jj^-1, whose columns stand in the order of the pivots, and of lu V = U_jj^-T.
template <class T>
void InverseFront<T>::begin_column(Index j, InverseColumn<T>& column, InverseScratch<T>& w) {
  const Index n = l_.width(j), at = s_.plan.tree.first[f_] + l_.begin(j);
  const Offset ld = padded<T>(n);
  s_.dense.unpack(n, n, s_.factor(f_) + l_.tile_offset(j, j), w.c.data(), ld);
  const T* inverse = w.c.data();
  if (s_.kind != Kind::llt) {
    const std::int32_t* perm = s_.pivot_order.data() + at;
    for (Index k = 0; k < n; ++k)
      std::memcpy(static_cast<void*>(w.permuted.data() + perm[k] * ld), w.c.data() + k * ld,
                  static_cast<std::size_t>(ld) * sizeof(T));
    inverse = w.permuted.data();
  }
  pack_across(n, n, inverse, column.right.data());
  negate_into(column.right.data(), column.left.data(), n);
  if (s_.kind == Kind::ldlt)
    s_.dense.scale_columns(n, n, column.right.data(), s_.d_inverse.data() + at, s_.e_inverse.data() + at,
                           column.right.data());
  if (s_.kind != Kind::lu) return;
  s_.dense.unpack(n, n, s_.factor2(f_) + l_.tile_offset(j, j), w.c.data(), ld);
  pack_across(n, n, w.c.data(), w.permuted.data());
  negate_into(w.permuted.data(), column.upper.data(), n);
}

template <class T>
void InverseFront<T>::solve_tile(Index i, Index j, InverseColumn<T>& column, InverseScratch<T>& w) {
  const Index m = l_.width(i), n = l_.width(j);
  const Offset ld = padded<T>(m);
  const auto times = [&](const T* factor, const base::Buffer<T>& inverse, base::Buffer<T>& to) {
    clear_tile(w.c.data(), ld, n);
    s_.dense.gemm_nt(m, n, n, factor + l_.tile_offset(i, j), inverse.data(), w.c.data(), ld);
    pack_across(m, n, w.c.data(), to.data() + place(i, j));
  };
  times(s_.factor(f_), column.left, column.g);
  if (s_.kind == Kind::lu) times(s_.factor2(f_), column.upper, column.h);
}

template <class T>
void InverseFront<T>::make_tile(Index i, Index j, const InverseColumn<T>& column, InverseScratch<T>& w) {
  const Index m = l_.width(i), n = l_.width(j);
  const Offset ld = padded<T>(m);
  const auto multiply = [&](const T* z, const base::Buffer<T>& by) {
    clear_tile(w.c.data(), ld, n);
    for (Index k = j + 1; k < l_.tiles; ++k)
      s_.dense.gemm_nt(m, n, l_.width(k), z + inverse_.tile(i, k), by.data() + place(k, j), w.c.data(), ld);
  };
  multiply(inverse_.z, column.g);
  s_.dense.pack(m, n, w.c.data(), ld, inverse_.z + inverse_.tile(i, j));
  pack_across(m, n, w.c.data(), inverse_.across + inverse_.tile(j, i));
  if (s_.kind != Kind::lu) return;
  multiply(inverse_.across, column.h);
  s_.dense.pack(m, n, w.c.data(), ld, inverse_.across + inverse_.tile(i, j));
  pack_across(m, n, w.c.data(), inverse_.z + inverse_.tile(j, i));
}

template <class T>
void InverseFront<T>::make_diagonal(Index j, const InverseColumn<T>& column, InverseScratch<T>& w) {
  const Index n = l_.width(j);
  const Offset ld = padded<T>(n);
  const bool lu = s_.kind == Kind::lu;
  T* c = w.c.data();
  clear_tile(c, ld, n);
  const auto subtract = lu ? s_.dense.gemm_nt : s_.dense.syrk_nt;  // of symmetric ones the lower triangle alone
  subtract(n, n, n, (lu ? column.upper : column.left).data(), column.right.data(), c, ld);
  const base::Buffer<T>& by = lu ? column.h : column.g;
  for (Index k = j + 1; k < l_.tiles; ++k)
    subtract(n, n, l_.width(k), by.data() + place(k, j), inverse_.across + inverse_.tile(j, k), c, ld);
  if (!lu)
    for (Index q = 0; q < n; ++q)
      for (Index r = q + 1; r < n; ++r) c[r * ld + q] = s_.hermitian ? base::conjugate(c[q * ld + r]) : c[q * ld + r];
  s_.dense.pack(n, n, c, ld, inverse_.z + inverse_.tile(j, j));
  if (lu) pack_across(n, n, c, inverse_.across + inverse_.tile(j, j));
}

#define ESPALIER_INSTANTIATE(T) template class InverseFront<T>;
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
