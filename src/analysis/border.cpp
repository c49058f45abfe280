#include "analysis/border.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

// Rows of the border by front, ascending.
using Rows = std::vector<std::vector<Index>>;

void merge(std::vector<Index>& to, const std::vector<Index>& from) {
  std::vector<Index> both;
  both.reserve(to.size() + from.size());
  std::set_union(to.begin(), to.end(), from.begin(), from.end(), std::back_inserter(both));
  to = std::move(both);
}

Rows own_rows(const AssemblyTree& tree, std::span<const BorderEntry> links) {
  std::vector<Index> front(at(tree.n));
  for (Index f = 0; f < tree.fronts(); ++f)
    std::fill(front.begin() + tree.first[at(f)], front.begin() + tree.first[at(f) + 1], f);
  Rows rows(at(tree.fronts()));
  for (const BorderEntry& l : links) rows[at(front[at(l.position)])].push_back(l.row);
  for (auto& list : rows) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return rows;
}

// Fronts stand in postorder: all roots before the last one that is coupled become its children.
void join_roots(AssemblyTree& tree, const Rows& rows) {
  Index last = -1;
  for (Index f = 0; f < tree.fronts(); ++f)
    if (tree.parent[at(f)] < 0 && !rows[at(f)].empty()) last = f;
  for (Index f = 0; f < last; ++f)
    if (tree.parent[at(f)] < 0) tree.parent[at(f)] = last;
}

}  // namespace

void add_border(AssemblyTree& tree, Index size, std::span<const BorderEntry> links) {
  Rows rows = own_rows(tree, links);
  for (Index f = 0; f < tree.fronts(); ++f)
    if (const Index up = tree.parent[at(f)]; up >= 0) merge(rows[at(up)], rows[at(f)]);
  join_roots(tree, rows);
  for (Index f = 0; f < tree.fronts(); ++f)
    if (const Index up = tree.parent[at(f)]; up >= 0 && tree.parent[at(up)] < 0) merge(rows[at(up)], rows[at(f)]);
  base::LazyVector<Index> all;
  std::vector<Offset> ptr(1, 0);
  for (Index f = 0; f < tree.fronts(); ++f) {
    all.append(tree.rows.begin() + tree.row_ptr[at(f)], tree.rows.begin() + tree.row_ptr[at(f) + 1]);
    for (const Index row : rows[at(f)]) all.push_back(tree.n + row);
    ptr.push_back(static_cast<Offset>(all.size()));
  }
  tree.rows = std::move(all);
  tree.row_ptr = std::move(ptr);
  tree.border = size;
}

Index border_root(const AssemblyTree& tree) {
  for (Index f = tree.fronts() - 1; f >= 0; --f)
    if (tree.parent[at(f)] < 0 && tree.rows_below(f) > 0) return f;
  return -1;
}

}  // namespace espalier::analysis
