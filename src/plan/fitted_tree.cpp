#include "plan/fitted_tree.hpp"

namespace espalier::plan {

namespace {

// Elements of the factor of a front with so many pivots and rows below.
Offset factor_elements(Index pivots, Index below, const PlanOptions& options) {
  const TileRule& tiles = options.tiles;
  const Index rows = pivots + below;
  const bool whole = rows <= tiles.whole_rows && pivots <= tiles.whole_pivots;
  const FrontForm tiled = rows <= tiles.narrow_rows ? FrontForm::narrow : FrontForm::wide;
  return options.arrays->factor_elements(cut_front(pivots, rows, tiles), whole ? FrontForm::whole : tiled);
}

}  // namespace

std::vector<analysis::PivotMove> moves_that_fit(const analysis::AssemblyTree& tree, const PlanOptions& options) {
  const Index chunk = options.tiles.panel, fronts = tree.fronts();
  std::vector<Index> pivots(at(fronts));  // as children have left them
  for (Index f = 0; f < fronts; ++f) pivots[at(f)] = tree.pivots(f);
  std::vector<analysis::PivotMove> moves;
  for (Index f = 0; f < fronts; ++f) {
    const Index parent = tree.parent[f];
    Index& mine = pivots[at(f)];
    const Index more = mine % chunk;
    if (parent < 0 || more == 0 || more > chunk / 2 || more >= tree.pivots(f)) continue;
    Index& its = pivots[at(parent)];
    const Index below = tree.rows_below(f), its_below = tree.rows_below(parent);
    const Offset before = factor_elements(mine, below, options) + factor_elements(its, its_below, options);
    const Offset after =
        factor_elements(mine - more, below + more, options) + factor_elements(its + more, its_below, options);
    if (after >= before) continue;
    mine -= more;
    its += more;
    for (Index p = tree.first[f + 1] - more; p < tree.first[f + 1]; ++p) moves.push_back({p, parent});
  }
  return moves;
}

}  // namespace espalier::plan
