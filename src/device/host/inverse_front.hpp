/// \file
/// The inverse of the factored matrix on the rows and columns of one front.
#pragma once

#include "base/memory.hpp"
#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// A front's part of the inverse Z = B^-1: all of its rows and columns, in tiles of panels as wide as those of the
/// front. Tile (i, k) holds Z(rows of i, columns of k); of lu, `across` holds Z(rows of k, columns of i)^T there.
template <class T>
struct FrontInverse {
  const plan::FrontLayout* layout = nullptr;
  T* z = nullptr;
  T* across = nullptr;  ///< of symmetric and Hermitian matrices: z itself

  /// Elements of one of the two arrays.
  static Offset size(const plan::FrontLayout& l) { return l.padded_begin(l.tiles) * l.rows; }
  [[nodiscard]] Offset tile(Index i, Index k) const {
    return layout->padded_begin(i) * layout->rows + layout->padded(layout->width(i)) * layout->begin(k);
  }
  /// Z(row, col), by rows of the front.
  [[nodiscard]] T at(Index row, Index col) const {
    const Index i = layout->tile_of(row), k = layout->tile_of(col), r = row - layout->begin(i);
    return z[tile(i, k) + Offset{r / layout->panel} * layout->panel * layout->width(k) +
             Offset{col - layout->begin(k)} * layout->panel + r % layout->panel];
  }
};

/// Working memory of one thread.
template <class T>
struct InverseScratch {
  /// @param widest  columns of the widest tile
  InverseScratch(Index widest, base::MemoryBudget* budget)
      : c(padded<T>(widest) * padded<T>(widest), budget), permuted(padded<T>(widest) * padded<T>(widest), budget) {}
  base::Buffer<T> c, permuted;  ///< a tile each, column-major
};

/// What the tiles of one block column share while it is made.
template <class T>
struct InverseColumn {
  InverseColumn(Index widest, Offset largest_column, bool lu, base::MemoryBudget* budget)
      : left(padded<T>(widest) * widest, budget),
        right(padded<T>(widest) * widest, budget),
        upper(lu ? padded<T>(widest) * widest : 0, budget),
        g(largest_column, budget),
        h(lu ? largest_column : 0, budget) {}
  /// Elements of g for the front.
  static Offset size(const plan::FrontLayout& l) { return padded<T>(l.pivot_width) * l.rows; }

  base::Buffer<T> left;   ///< -L^-T of the diagonal tile, its rows in the order of the front
  base::Buffer<T> right;  ///< L^-T D^-1 likewise
  base::Buffer<T> upper;  ///< lu: -U^-1
  base::Buffer<T> g, h;   ///< tiles of (L_Ij L_jj^-1)^T; lu: of U_jj^-1 U_jI. A panel tile for each tile row below j
};

/// The block columns of a front's inverse, from the last pivots to the first. With L = [L_jj; L_Ij] and U = [U_jj U_jI]
/// (symmetric matrices: U = D L^T),
///
///   Z_Ij = -Z_II (L_Ij L_jj^-1),   Z_jI = -(U_jj^-1 U_jI) Z_II,   Z_jj = U_jj^-1 L_jj^-1 - (U_jj^-1 U_jI) Z_Ij
///
/// (Takahashi, Fagan and Chin 1973; by blocks as in Campbell and Davis 1995). Each call makes one tile in a fixed order
/// of operations, so that bits do not depend on who works.
template <class T>
class InverseFront {
 public:
  InverseFront(NumericState<T>& state, Index front, FrontInverse<T> inverse)
      : s_(state), f_(front), l_(state.plan.layout[static_cast<std::size_t>(front)]), inverse_(inverse) {}

  /// Tile row i below the pivots, of what the parent knows. @param parent  its inverse
  void take_from_parent(const FrontInverse<T>& parent, Index i, InverseScratch<T>& w);
  /// What the tiles of column j share; before all others.
  void begin_column(Index j, InverseColumn<T>& column, InverseScratch<T>& w);
  /// Solves the tile of tile row i > j: g and h. @pre begin_column(j)
  void solve_tile(Index i, Index j, InverseColumn<T>& column, InverseScratch<T>& w);
  /// Tiles (i, j) and (j, i). @pre solve_tile() of all rows below j
  void make_tile(Index i, Index j, const InverseColumn<T>& column, InverseScratch<T>& w);
  /// Tile (j, j). @pre make_tile() of all rows below j
  void make_diagonal(Index j, const InverseColumn<T>& column, InverseScratch<T>& w);

 private:
  void pack_across(Index rows, Index cols, const T* c, T* panels) const;
  void negate_into(const T* from, T* to, Index n) const;
  void copy_from_parent(const FrontInverse<T>& parent, Index i, Index k, const T* from, InverseScratch<T>& w) const;
  [[nodiscard]] Offset place(Index i, Index j) const {  // in g and h
    return padded<T>(l_.width(j)) * (l_.begin(i) - l_.begin(j + 1));
  }

  NumericState<T>& s_;
  Index f_;
  const plan::FrontLayout& l_;
  FrontInverse<T> inverse_;
};

}  // namespace espalier::device::host
