#include "solver/factor/pivot_policy.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <span>
#include <utility>

namespace espalier::solver {

namespace {

using Positions = std::vector<Index>;

Positions together(const Positions& a, const Positions& b) {
  Positions all;
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
  return all;
}

// The range of ascending positions from `first` to below `end`.
std::span<const Index> within(const Positions& all, Index first, Index end) {
  const auto begin = std::lower_bound(all.begin(), all.end(), first);
  return {begin, std::lower_bound(begin, all.end(), end)};
}

Positions in_both(std::span<const Index> a, std::span<const Index> b) {
  Positions both;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return both;
}

}  // namespace

Positions unstable_pivots(const device::FactorOutcome& outcome) {
  Positions others;
  std::set_difference(outcome.failed.begin(), outcome.failed.end(), outcome.replaced.begin(), outcome.replaced.end(),
                      std::back_inserter(others));
  return others;
}

Positions pivots_to_move(const plan::Plan& plan, const device::FactorOutcome& outcome, bool zeros_stay) {
  Positions moved;
  const Positions bad = zeros_stay ? outcome.failed : together(outcome.failed, outcome.replaced);
  if (bad.empty()) return moved;
  const auto& tree = plan.tree;
  std::vector<char> below(at(tree.fronts()), 0);  // 1: a failure in the sub-tree below
  for (Index f = 0; f < tree.fronts(); ++f) {
    const Index first = tree.first[f], end = tree.first[f + 1];
    std::span<const Index> here = within(bad, first, end);
    const bool root = tree.parent[f] < 0;
    if (!root && (below[f] != 0 || !here.empty())) below[tree.parent[f]] = 1;
    if (below[f] != 0) continue;
    // Rows that vanishing columns of lu took may be pivots of others: of those of this front if these stand at the end,
    // or of those above.
    Positions with_rows;
    if (zeros_stay && !outcome.replaced_rows.empty()) {
      const Positions takers = in_both(here, outcome.replaced);
      if (root && !takers.empty()) {
        if (takers.front() + static_cast<Index>(takers.size()) < end)
          moved.insert(moved.end(), takers.begin(), takers.end());
        continue;
      }
      if (!takers.empty()) {
        const auto rows = within(outcome.replaced_rows, first, end);
        std::set_union(here.begin(), here.end(), rows.begin(), rows.end(), std::back_inserter(with_rows));
        here = with_rows;
      }
    }
    // In a root, a pivot may still find its partner in the last block column.
    const auto& l = plan.layout[f];
    for (const Index p : here)
      if (!root || l.tile_of(p - first) + 1 < l.pivot_tiles) moved.push_back(p);
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
