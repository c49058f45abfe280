/// \file
/// Supernodes of an elimination tree, their amalgamation to fronts, and the rows of the fronts.
#pragma once

#include <span>
#include <vector>

#include "analysis/ordering/graph.hpp"

namespace espalier::analysis {

/// A tree of fronts by their sizes alone. Fronts stand in postorder.
struct FrontTree {
  std::vector<Index> parent;  ///< fronts; -1 for a root
  std::vector<Index> first;   ///< fronts + 1; front f eliminates the vertices order[first[f]] .. order[first[f+1]-1]
  std::vector<Index> order;   ///< vertices in elimination order
  std::vector<Index> width;   ///< fronts; unknowns eliminated
  std::vector<Index> below;   ///< fronts; unknowns among the rows below the pivots

  [[nodiscard]] Index fronts() const { return static_cast<Index>(parent.size()); }
};

/// Time of one small front as the amalgamation sees it, fitted to refactorizations on the host
/// (docs/notebook/machine_model.md):
///   seconds = front + entry * (entries of its columns) + contribution * (entries handed to the parent)
///           + flop * flops * (1 + narrow / width),
/// and `tiled` more for a front that is no single task on a GPU.
struct AmalgamationCost {
  double front = 1.5e-6;       ///< seconds per front: tasks, bookkeeping
  double entry = 0.4e-9;       ///< seconds per entry of the factor: cleared, assembled, written
  double contribution = 1e-9;  ///< seconds per entry of the contribution block: written, read, added
  double flop = 1.0 / 15e9;    ///< seconds per flop of a front of some dozen columns on one core
  double narrow = 8;           ///< width at which a front runs at half that rate
  /// Beyond these sizes GPUs cut a front into tiles, and its tasks wait for each other. In a chain of bodies that is
  /// half of all time; on the host such trees are no slower (docs/notebook/gpu.md, "Fronts of one task").
  Index whole_rows = 64, whole_pivots = 32;
  double tiled = 4e-6;
};

/// Fundamental supernodes (Liu, Ng, Peyton 1993).
/// @param count total weight of the rows of each column of L, itself included (column_weights)
FrontTree fundamental_supernodes(std::span<const Index> parent, std::span<const Index> weight,
                                 std::span<const Index> count);

/// Merges fronts into their parents wherever that saves time by `cost`, and tiny roots with each other (a diagonal
/// matrix would have a front per unknown); puts the children of each front into the order of Liu (1986) that needs the
/// smallest stack of contribution blocks.
FrontTree amalgamate(const FrontTree& tree, const AmalgamationCost& cost);

/// Writes the rows of front f below its pivots, as places in tree.order, ascending, from rows[row_ptr[f]] on.
/// @param row_ptr fronts + 1; room for tree.below[f] entries each (as many as unknowns, so the vertices fit)
/// @return how many there are of each front
std::vector<Index> front_rows(const Graph& graph, const FrontTree& tree, std::span<const Offset> row_ptr,
                              std::span<Index> rows, base::ThreadPool& pool);

/// Entries of L, diagonal included, in a front of `width` pivots with `below` rows under them.
double front_entries(double width, double below);
/// Sum over its columns of (entries of the column)^2: the flops of L L^T.
double front_flops(double width, double below);

}  // namespace espalier::analysis
