/// \file
/// A vertex separator and its local improvement.
#pragma once

#include <array>
#include <vector>

#include "analysis/ordering/coarsen.hpp"

namespace espalier::analysis {

/// Side 0, side 1 and the separator (2): no edge joins the sides.
struct Separation {
  std::vector<char> side;          ///< n
  std::array<Offset, 3> weight{};  ///< of side 0, side 1, separator
};

/// What makes a separation good: its separator's weight times (1 + imbalance^2 / 10), imbalance = difference of the
/// sides over their sum. The work of eliminating a side grows like the square of its size in 3-D, so that of both like
/// 1 + imbalance^2; but a smaller separator also leaves smaller fronts in all parts below, which weighs more: with a
/// tenth of the imbalance flops fall by 5 % on the mean of six scalar grids (docs/notebook/ordering.md). The hard bound
/// is `most_side`.
double score(const Separation& s);

/// Lowers the score by passes of Fiduccia and Mattheyses (1982) in the form for vertex separators (Ashcraft and Liu
/// 1997): vertices move from the separator to one side, each pulling its neighbours on the other side in, with hill
/// climbing and return to the best state seen. A pass moves in one direction only, so that the separator sweeps through
/// the graph and straightens; with both directions in one pass it stayed crumpled (a third larger on a cube of nodes).
/// @param most_side neither side is made heavier than that
void refine(const PartGraph& graph, Offset most_side, int passes, Separation& separation);

}  // namespace espalier::analysis
