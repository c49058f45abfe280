#include "analysis/relocation.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace espalier::analysis {

namespace {

auto at(Index k) { return static_cast<std::size_t>(k); }
auto at(Offset k) { return static_cast<std::size_t>(k); }

/// Where everything goes: for each front the old positions that leave and those that arrive.
struct Moves {
  std::vector<std::vector<Index>> leaving, arriving;  // fronts; ascending

  Moves(const AssemblyTree& t, std::span<const Index> positions) : leaving(at(t.fronts())), arriving(at(t.fronts())) {
    for (const Index p : positions) {
      const auto f = std::upper_bound(t.first.begin(), t.first.end(), p) - t.first.begin() - 1;
      leaving[static_cast<std::size_t>(f)].push_back(p);
    }
    for (Index f = 0; f < t.fronts(); ++f) {
      auto& mine = leaving[at(f)];
      std::sort(mine.begin(), mine.end());
      auto& to = arriving[t.parent[at(f)] < 0 ? at(f) : at(t.parent[at(f)])];
      to.insert(to.end(), mine.begin(), mine.end());
    }
    for (auto& list : arriving) std::sort(list.begin(), list.end());
  }
};

}  // namespace

void relocate_pivots(AssemblyTree& tree, std::span<const Index> positions) {
  if (positions.empty()) return;
  const Moves moves(tree, positions);
  std::vector<Index> where(at(tree.n));            // old position -> new position
  std::vector<Index> name(at(tree.fronts()), -1);  // old front -> new front
  AssemblyTree out;
  out.n = tree.n;
  out.first.push_back(0);
  std::vector<Index> kept_fronts;
  for (Index f = 0; f < tree.fronts(); ++f) {
    const auto& leaving = moves.leaving[at(f)];
    std::vector<Index> pivots;
    for (Index p = tree.first[at(f)]; p < tree.first[at(f) + 1]; ++p)
      if (!std::binary_search(leaving.begin(), leaving.end(), p)) pivots.push_back(p);
    pivots.insert(pivots.end(), moves.arriving[at(f)].begin(), moves.arriving[at(f)].end());
    if (pivots.empty()) continue;
    for (const Index p : pivots) {
      where[at(p)] = static_cast<Index>(out.order.size());
      out.order.push_back(tree.order[at(p)]);
    }
    name[at(f)] = static_cast<Index>(kept_fronts.size());
    kept_fronts.push_back(f);
    out.first.push_back(static_cast<Index>(out.order.size()));
  }
  out.row_ptr.push_back(0);
  for (const Index f : kept_fronts) {
    Index parent = tree.parent[at(f)];
    while (parent >= 0 && name[at(parent)] < 0) parent = tree.parent[at(parent)];
    out.parent.push_back(parent < 0 ? -1 : name[at(parent)]);
    const auto begin = static_cast<std::ptrdiff_t>(out.rows.size());
    const Index last = out.first[at(name[at(f)]) + 1] - 1;
    const auto add =
        [&](Index p) {  // an arrived column of a child was a row of nobody; the front's own rows stay below
          if (where[at(p)] > last) out.rows.push_back(where[at(p)]);
        };
    for (Offset k = tree.row_ptr[at(f)]; k < tree.row_ptr[at(f) + 1]; ++k) add(tree.rows[at(k)]);
    if (tree.parent[at(f)] >= 0)
      for (const Index p : moves.leaving[at(f)]) add(p);
    std::sort(out.rows.begin() + begin, out.rows.end());
    out.row_ptr.push_back(static_cast<Offset>(out.rows.size()));
  }
  tree = std::move(out);
}

}  // namespace espalier::analysis
