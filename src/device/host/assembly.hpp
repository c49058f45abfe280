/// \file
/// Gathering into a tile: entries of A and the children's contributions.
#pragma once

#include <limits>

#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// The part of a front that is being made: rows [row_begin, row_end), columns [col_begin, col_end) of the front, in
/// column-major scratch.
template <class T>
struct FrontBlock {
  T* data;
  Offset ld;
  Index row_begin, row_end, col_begin, col_end;
};

/// Columns of a contribution.
struct ColumnRange {
  Index begin = 0;
  Index end = std::numeric_limits<Index>::max();
};

/// Adds the lower contribution of front `child` (rows >= columns), as far as its columns lie in `columns`, to the part
/// of the parent.
/// @param source  start of the child's contribution array (lower, or transposed upper)
/// @param mirror  true: element (r, c) is added at (c, r) of the part, and diagonal elements are left out: the upper
///                triangle of a square part (lu)
template <class T>
void add_contribution(const plan::Plan& plan, Index child, const T* source, const FrontBlock<T>& part, bool mirror,
                      std::vector<Run>& runs, ColumnRange columns = {});

/// Adds the entries of A that belong to the tile. transposed_part: the U^T part of an off-diagonal tile takes the
/// transposed entries, its L part the others; a square part (diagonal tile or whole front) takes both.
enum class EntryPart { lower, transposed, square };
template <class T>
void add_entries(std::span<const plan::EntryPlace> entries, std::span<const T> values, T* c, Offset ld, EntryPart part);

}  // namespace espalier::device::host
