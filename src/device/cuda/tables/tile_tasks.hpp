/// \file
/// The tasks of a tiled front, tile column by tile column: the one text behind all lists, in core and out of core.
#pragma once

#include <algorithm>
#include <limits>
#include <utility>

#include "device/cuda/tables/front_shape.hpp"

namespace espalier::device::cuda {

/// Which tasks of a large front follow each other. What runs side by side should read the same rows: with one tile
/// column after another, each reads all that stands to its left from memory (flops / 16 bytes: 0.8 TB for elasticity
/// 64^3).
struct TaskOrder {
  Index group_columns = 16;  ///< tile columns of the contribution that are worked on together, ...
  Index group_blocks = 8;    ///< ... so many row blocks of each at a time
  Index pair_from = 64;      ///< wide pivot columns from this one on are taken in pairs, row block by row block
  /// The diagonal tile of the next column is listed as soon as what it needs has been, so that it is ready when that
  /// column begins; else at the head of its own column.
  bool look_ahead = true;
  /// Wide tile columns go two by two where a device takes them so (Work::two_columns), ...
  bool two_columns = false;
  Index two_pivot_columns_from = 8;  ///< ... those of pivots from this one on, an even number

  /// One tile column after another: out of core, where the columns to the left come by in groups anyway.
  static constexpr TaskOrder by_columns(bool look_ahead) {
    return {1, 1 << 24, std::numeric_limits<Index>::max(), look_ahead};
  }
};

class TileTasks {
 public:
  TileTasks(Kind kind, const TaskOrder& order) : parts_(kind == Kind::lu ? 2 : 1), order_(order) {}

  /// Calls use(Work, part, block, column) for the tasks that begin with tile column j of front x; a column that goes
  /// with an earlier one has none of its own.
  template <class Use>
  void column(const Front& x, Index j, Use&& use) const {
    const Index paired = order_.pair_from, two = order_.two_pivot_columns_from;
    if (j >= x.pivot_tiles) {
      if ((j - x.pivot_tiles) % order_.group_columns == 0)
        contribution(x, j, std::min(j + order_.group_columns, x.tiles), use);
    } else if (goes_two_by_two(x) && order_.look_ahead && j >= two) {
      if ((j - two) % 2 == 0) two_pivots(x, j, use);
    } else if (x.width != kWideTiles || j < paired || !order_.look_ahead) {
      pivots(x, j, j + 1, use);
    } else if ((j - paired) % 2 == 0) {
      pivots(x, j, std::min(j + 2, x.pivot_tiles), use);
    }
  }

 private:
  template <class Use>
  void block(Index a, Index j, Use& use) const {
    for (int part = 0; part < parts_; ++part) use(Work::block, part, a, j);
  }

  // Columns [begin, end) of the contribution, in rectangles of the rows.
  template <class Use>
  void contribution(const Front& x, Index begin, Index end, Use& use) const {
    for (Index first = x.block_of_column(begin); first < x.blocks; first += order_.group_blocks) {
      const Index last = std::min(first + order_.group_blocks, x.blocks);
      for (Index j = begin; j < end;) {
        // Both in one row block.
        const bool two = goes_two_by_two(x) && (j - x.pivot_tiles) % 2 == 0 && j + 1 < end;
        const Index next = j + (two ? 2 : 1);
        for (Index a = first; a < last; ++a)
          if (two && x.block_begin(a) >= x.column_end(j + 1)) {
            two_columns(x, a, j, use);
          } else {
            for (Index k = j; k < next; ++k)
              if (x.block_end(a) > x.column_begin(k)) block(a, k, use);
          }
        j = next;
      }
    }
  }
  [[nodiscard]] bool goes_two_by_two(const Front& x) const { return order_.two_columns && x.width == kWideTiles; }
  // Row block a of columns j and j + 1, below both; one by one where it is small.
  template <class Use>
  void two_columns(const Front& x, Index a, Index j, Use& use) const {
    if (x.block_end(a) - x.block_begin(a) <= kWideTiles) {
      block(a, j, use);
      block(a, j + 1, use);
      return;
    }
    for (int part = 0; part < parts_; ++part) use(Work::two_columns, part, a, j);
  }
  // Pivot columns j, an even number, and j + 1, row block by row block. Their diagonal tiles lie in one of them.
  template <class Use>
  void two_pivots(const Front& x, Index j, Use& use) const {
    const Index own = x.block_of_column(j), next = j + 2;
    if (next > x.pivot_tiles) return pivots(x, j, j + 1, use);
    if (j == 0) use(Work::diagonal, 0, 0, 0);
    block(own, j, use);
    use(Work::diagonal, 0, 0, j + 1);
    for (Index a = own + 1; a < x.blocks; ++a) {
      two_columns(x, a, j, use);
      if (next < x.pivot_tiles && a == x.block_of_column(next)) use(Work::diagonal, 0, 0, next);
    }
  }

  // Pivot columns [begin, end), row block by row block.
  template <class Use>
  void pivots(const Front& x, Index begin, Index end, Use& use) const {
    if (begin == 0 || !order_.look_ahead) use(Work::diagonal, 0, 0, begin);
    Index next = order_.look_ahead ? begin + 1 : x.pivot_tiles;  // diagonal tile
    for (Index a = x.block_of_column(begin); a < x.blocks; ++a)
      for (Index j = begin; j < end; ++j) {
        if (x.block_end(a) > x.column_end(j)) block(a, j, use);
        // Diagonal tile j + 1 needs its row block in columns up to j.
        if (next != j + 1 || next == x.pivot_tiles || a < x.block_of_column(next)) continue;
        use(Work::diagonal, 0, 0, next);
        ++next;
      }
  }

  int parts_;
  TaskOrder order_;
};

}  // namespace espalier::device::cuda
