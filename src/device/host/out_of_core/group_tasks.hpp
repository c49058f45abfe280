/// \file
/// Groups of block columns of a front that is too large for the device: making their tiles in place, step by step. What
/// is not final yet stands column-major in the tile's place, the leading dimension its padded rows.
#pragma once

#include "device/host/assembly.hpp"
#include "device/host/numeric_state.hpp"

namespace espalier::device::host {

/// Pivot block columns [begin, end) of a front: as in the factor array (row < 0), or with the rows of tile rows from
/// `row` on only, one block column after another.
template <class T>
struct SlabColumns {
  Index front = -1;
  Index begin = 0, end = 0;
  Index row = -1;
  const T* part[2] = {nullptr, nullptr};  ///< L; U^T (lu) or L D (ldlt)
};

/// Columns of the contribution of a child.
template <class T>
struct ChildColumns {
  Index front = -1;
  const T* part[2] = {nullptr, nullptr};  ///< starts of its arrays: lower; upper (lu)
  ColumnRange columns = {};
};

/// Elements before block column `column` of a slab whose rows begin with tile row `row` and columns with `begin`.
Offset slab_offset(const plan::FrontLayout& layout, Index begin, Index column, Index row);

/// Zeroes tile (i, j) of front f and adds the entries of A.
template <class T>
void begin_tile(NumericState<T>& state, Index f, Index i, Index j);

/// Adds what the columns of a child bring to tile (i, j) of front f.
template <class T>
void add_child_to_tile(NumericState<T>& state, Workspace<T>& work, Index f, Index i, Index j,
                       const ChildColumns<T>& child);

/// Subtracts the products of the slab's columns.
template <class T>
void update_tile(NumericState<T>& state, Index i, Index j, const SlabColumns<T>& slab);

}  // namespace espalier::device::host
