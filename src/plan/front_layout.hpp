/// \file
/// How a front is cut into tiles, and where each tile and contribution entry lies in the host's arenas.
#pragma once

#include <cstdint>

#include "espalier/types.hpp"

namespace espalier::plan {

/// A front of `rows` rows whose first `pivots` columns are eliminated. Tile rows (and columns) 0 .. pivot_tiles-1 hold
/// the pivots, the others the rows below. Tile (i, j), i >= j, has the rows of tile row i and the columns of tile row
/// j. All offsets are in elements, 0-based.
///
/// Two arrays belong to a front:
///  - the *factor*: block columns j < pivot_tiles one after another, each a sequence of tiles i = j .. tiles-1 with
///    `width(j)` columns and padded rows (see device/host/kernels/kernels.hpp, panels);
///  - the *contribution*: block columns j >= pivot_tiles, each a sequence of column-major tiles i = j .. tiles-1 whose
///    leading dimension is the padded number of rows and whose columns are padded likewise, so that the dense kernels
///    work in place; only entries with row >= column are meaningful. Tiles below are counted from 0 here.
struct FrontLayout {
  Index pivots = 0;
  Index rows = 0;
  Index pivot_width = 1;  ///< columns of every pivot tile but the last; a multiple of the panel when pivot_tiles > 1
  Index below_width = 1;  ///< rows of every tile below but the last; a multiple of the panel when there are several
  Index pivot_tiles = 0;
  Index tiles = 0;  ///< pivot_tiles + tiles below
  Index panel = 8;  ///< rows of a tile are padded to a multiple of it; a power of two

  [[nodiscard]] Index below() const { return rows - pivots; }
  [[nodiscard]] Offset padded(Offset x) const { return (x + panel - 1) & -Offset{panel}; }
  /// First row of tile row i; begin(tiles) == rows.
  [[nodiscard]] Index begin(Index i) const {
    if (i < pivot_tiles) return i * pivot_width;
    const Offset at = pivots + static_cast<Offset>(i - pivot_tiles) * below_width;
    return at < rows ? static_cast<Index>(at) : rows;
  }
  [[nodiscard]] Index width(Index i) const {
    const Index b = begin(i);
    const Index e = i + 1 == pivot_tiles ? pivots : begin(i + 1);
    return e - b;
  }
  /// The tile row in which row r of the front lies.
  [[nodiscard]] Index tile_of(Index r) const {
    return r < pivots ? r / pivot_width : pivot_tiles + (r - pivots) / below_width;
  }
  /// First row of tile row i when every tile row is padded to whole panels.
  [[nodiscard]] Offset padded_begin(Index i) const {
    if (i < pivot_tiles) return static_cast<Offset>(i) * pivot_width;
    const Offset pivot_end =
        pivot_tiles == 0 ? 0 : static_cast<Offset>(pivot_tiles - 1) * pivot_width + padded(width(pivot_tiles - 1));
    if (i < tiles) return pivot_end + static_cast<Offset>(i - pivot_tiles) * below_width;
    const Index last = tiles - 1;
    if (last < pivot_tiles) return pivot_end;
    return pivot_end + static_cast<Offset>(last - pivot_tiles) * below_width + padded(width(last));
  }
  /// Start of tile (i, j), j < pivot_tiles, in the factor array.
  [[nodiscard]] Offset tile_offset(Index i, Index j) const {
    const Offset total = padded_begin(tiles);
    const Offset column =
        static_cast<Offset>(pivot_width) * (j * total - static_cast<Offset>(pivot_width) * j * (j - 1) / 2);
    return column + width(j) * (padded_begin(i) - padded_begin(j));
  }
  /// Elements of the factor array.
  [[nodiscard]] Offset factor_size() const {
    if (pivot_tiles == 0) return 0;
    const Index j = pivot_tiles - 1;
    return tile_offset(j, j) + width(j) * (padded_begin(tiles) - padded_begin(j));
  }
  [[nodiscard]] Index tiles_below() const { return tiles - pivot_tiles; }
  /// Rows (columns) of tile row i below the pivots.
  [[nodiscard]] Index below_rows(Index i) const { return width(pivot_tiles + i); }
  /// Start of tile (i, j) below the pivots, i >= j, in the contribution array.
  [[nodiscard]] Offset contribution_offset(Index i, Index j) const {
    const Offset rows_padded = padded_begin(tiles) - padded_begin(pivot_tiles);
    const Offset w = below_width;
    return w * (j * rows_padded - w * j * (j - 1) / 2) + padded(below_rows(j)) * (i - j) * w;
  }
  /// Leading dimension of the tiles of row i below the pivots.
  [[nodiscard]] Offset contribution_ld(Index i) const { return padded(below_rows(i)); }
  [[nodiscard]] Offset contribution_size() const {
    const Index last = tiles_below() - 1;
    if (last < 0) return 0;
    return contribution_offset(last, last) + padded(below_rows(last)) * padded(below_rows(last));
  }
  /// Number of tiles (i, j), tiles > i >= j: the tasks of the front when it is not taken whole.
  [[nodiscard]] Offset tile_count() const { return static_cast<Offset>(tiles) * (tiles + 1) / 2; }
  /// Place of tile (i, j) among them, column by column.
  [[nodiscard]] Offset tile_index(Index i, Index j) const {
    return static_cast<Offset>(j) * tiles - static_cast<Offset>(j) * (j - 1) / 2 + (i - j);
  }
};

/// Widths of tiles by the size of the front.
struct TileRule {
  Index panel = 8;           ///< rows of a panel (8 for FP64, 16 for FP32)
  Index whole_rows = 128;    ///< a front of at most that many rows and ...
  Index whole_pivots = 96;   ///< ... at most that many pivots is one task with one pivot tile
  Index max_block_size = 0;  ///< widest tile; 0: by front size
  Index narrow_rows = 0;     ///< fronts of at most that many rows are cut into tiles of at most ...
  Index narrow_width = 0;    ///< ... this width; 0: no such rule
  bool even = true;          ///< true: tiles of a front are of even width; false: all but the last as wide as allowed
};

/// Cuts a front of `rows` rows with `pivots` pivots.
FrontLayout cut_front(Index pivots, Index rows, const TileRule& rule);

}  // namespace espalier::plan
