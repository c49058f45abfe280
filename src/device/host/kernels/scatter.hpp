/// \file
/// Adding a tile of a child's contribution to a part of the parent's front, vectorised over runs of consecutive rows.
#pragma once

#include "device/host/assembly.hpp"

namespace espalier::device::host {

/// One tile of the child and where its columns go. Rows and columns are those of the child's contribution.
template <class T>
struct Scatter {
  const T* tile;  ///< column-major, its element (0, 0) is (row_origin, col_origin)
  Offset tile_ld;
  Index row_origin, col_origin;
  Index col_begin, col_end;  ///< columns to add
  const Index* relative;     ///< row (column) of the parent's front for each of the child
  Index part_col_begin;      ///< first column of the part in the parent's front
  T* part;                   ///< column-major
  Offset part_ld;
};

/// part(target of r, target of c) += tile(r, c) for rows r >= c of the runs.
template <class T>
void scatter(const Run* runs, Index run_count, const Scatter<T>& task);

/// part(target of c, target of r) += tile(r, c) for rows r > c: the transposed upper triangle of a square part, whose
/// row and column ranges are the same.
template <class T>
void scatter_mirrored(const Run* runs, Index run_count, const Scatter<T>& task);

}  // namespace espalier::device::host
