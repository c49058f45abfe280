#include "solver/pivot_policy.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace espalier::solver {

std::vector<Index> pivots_to_move(const plan::Plan& plan, const device::FactorOutcome& outcome, bool zeros_stay) {
  std::vector<Index> moved;
  std::vector<Index> bad(outcome.failed);
  if (!zeros_stay) bad.insert(bad.end(), outcome.replaced.begin(), outcome.replaced.end());
  if (bad.empty()) return moved;
  std::sort(bad.begin(), bad.end());
  bad.erase(std::unique(bad.begin(), bad.end()), bad.end());
  const auto& tree = plan.tree;
  std::vector<char> below(static_cast<std::size_t>(tree.fronts()), 0);  // 1: a failure in the sub-tree below
  std::size_t at = 0;
  for (Index f = 0; f < tree.fronts(); ++f) {
    bool any = below[f] != 0;
    for (; at < bad.size() && bad[at] < tree.first[f + 1]; ++at) {
      // In a root, a pivot may still find its partner in the last block column.
      const auto& l = plan.layout[f];
      const bool may_move = tree.parent[f] >= 0 || l.tile_of(bad[at] - tree.first[f]) + 1 < l.pivot_tiles;
      if (below[f] == 0 && may_move) moved.push_back(bad[at]);
      any = true;
    }
    if (any && tree.parent[f] >= 0) below[tree.parent[f]] = 1;
  }
  return moved;
}

device::FactorOutcome with_suspects(device::FactorOutcome llt) {
  llt.small = std::move(llt.replaced);
  llt.replaced.clear();
  return llt;
}

bool turns_to_ldlt(Kind kind, bool kind_may_change, const device::FactorOutcome& outcome) {
  return kind == Kind::llt && kind_may_change && outcome.not_positive >= 0;
}

bool is_narrow(Index widest_tile) {
  constexpr Index kFreeTiles = 128;
  return widest_tile > 0 && widest_tile < kFreeTiles;
}

double zero_pivot(Index n, double epsilon) { return 4 * epsilon * std::sqrt(static_cast<double>(n)); }

auto PivotPolicy::next(Index movable, const std::function<bool()>& factor_solves) -> Step {
  const int most = narrow_ ? kMovesInNarrowTiles : kMostMoves;
  // A few may have a long way to go, one front a round.
  in_vain_ = movable > kFew && movable >= fewest_ ? in_vain_ + 1 : 0;
  fewest_ = std::min(fewest_, movable);
  const bool exhausted = round_ == most || in_vain_ >= kMostInVain || searches_ >= kMostSearches;
  if (movable > 0 && !exhausted) {
    ++round_;
    return Step::move;
  }
  if (narrow_ && exhausted && !factor_solves()) {
    *this = PivotPolicy(false);
    return Step::widen;
  }
  return Step::stop;
}

}  // namespace espalier::solver
