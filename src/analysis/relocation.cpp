#include "analysis/relocation.hpp"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

Index front_of(const AssemblyTree& t, Index position) {
  return static_cast<Index>(std::upper_bound(t.first.begin(), t.first.end(), position) - t.first.begin()) - 1;
}

/// For each front the old positions that leave it, that arrive, and that it hands on to its parent (its own among
/// them); ascending.
struct Moves {
  std::vector<std::vector<Index>> leaving, arriving, passing;

  Moves(const AssemblyTree& t, std::span<const PivotMove> moves)
      : leaving(at(t.fronts())), arriving(at(t.fronts())), passing(at(t.fronts())) {
    for (const PivotMove& m : moves) {
      const Index from = front_of(t, m.position);
      leaving[at(from)].push_back(m.position);
      arriving[at(m.front)].push_back(m.position);
      for (Index f = from; f != m.front; f = t.parent[at(f)]) passing[at(f)].push_back(m.position);
    }
    for (auto* lists : {&leaving, &arriving, &passing})
      for (auto& list : *lists) std::sort(list.begin(), list.end());
  }
};

}  // namespace

std::vector<PivotMove> one_front_up(const AssemblyTree& tree, std::span<const Index> positions) {
  std::vector<PivotMove> moves;
  for (const Index p : positions) {
    const Index f = front_of(tree, p), parent = tree.parent[at(f)];
    moves.push_back({p, parent < 0 ? f : parent});
  }
  return moves;
}

std::vector<Index> relocate_pivots(AssemblyTree& tree, std::span<const PivotMove> list, base::ThreadPool* pool) {
  std::vector<Index> kept_fronts;
  if (list.empty()) {
    kept_fronts.resize(at(tree.fronts()));
    std::iota(kept_fronts.begin(), kept_fronts.end(), 0);
    return kept_fronts;
  }
  const Moves moves(tree, list);
  std::vector<Index> where(at(tree.n + tree.border));  // old position -> new position
  std::iota(where.begin() + tree.n, where.end(), tree.n);
  std::vector<Index> name(at(tree.fronts()), -1);  // old front -> new front
  AssemblyTree out;
  out.n = tree.n;
  out.border = tree.border;
  out.first.push_back(0);
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
  // Columns go up alone: what is below a front's pivots stays there, and what is passed on comes to it.
  out.row_ptr.push_back(0);
  for (const Index f : kept_fronts) {
    Index parent = tree.parent[at(f)];
    while (parent >= 0 && name[at(parent)] < 0) parent = tree.parent[at(parent)];
    out.parent.push_back(parent < 0 ? -1 : name[at(parent)]);
    out.row_ptr.push_back(out.row_ptr.back() + tree.rows_below(f) + static_cast<Offset>(moves.passing[at(f)].size()));
  }
  out.rows.resize(at(out.row_ptr.back()));
  const auto write_rows = [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k) {
      const Index f = kept_fronts[k];
      const auto first = out.rows.begin() + out.row_ptr[k];
      auto next = first;
      for (Offset r = tree.row_ptr[at(f)]; r < tree.row_ptr[at(f) + 1]; ++r) *next++ = where[at(tree.rows[at(r)])];
      for (const Index p : moves.passing[at(f)]) *next++ = where[at(p)];
      if (!std::is_sorted(first, next)) std::sort(first, next);
    }
  };
  constexpr std::int64_t kFronts = 256;  // per range of work
  const auto fronts = static_cast<std::int64_t>(kept_fronts.size());
  if (pool != nullptr)
    pool->for_each_range(fronts, kFronts, write_rows);
  else
    write_rows(0, fronts);
  tree = std::move(out);
  return kept_fronts;
}

}  // namespace espalier::analysis
