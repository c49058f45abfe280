#include "analysis/elimination_tree.hpp"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <utility>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

constexpr std::int64_t kTreeRange = 4096;  // per range of a loop

/// Positions begin .. end - 1.
struct Range {
  Index begin, end;
};

/// Work that is dealt out side by side: at most a 64th of all, so that sixteen threads end at about the same time.
Index most_in_range(Index n) { return n / 64 + 1; }

/// Disjoint ranges of positions, ascending, from which no edge leads to a lower position outside. Every vertex is at
/// first such a range; one with an edge to a lower position takes in all ranges between. The largest ones that are
/// small enough stay.
std::vector<Range> closed_ranges(const Graph& graph, std::span<const Index> order, std::span<const Index> position,
                                 base::ThreadPool& pool) {
  std::vector<Index> low(order.size());  // the lowest position among the neighbours and the vertex itself
  pool.for_each_range(graph.n, kTreeRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = static_cast<Index>(begin); k < static_cast<Index>(end); ++k) {
      low[at(k)] = k;
      for (const Index u : graph.neighbours(order[at(k)])) low[at(k)] = std::min(low[at(k)], position[at(u)]);
    }
  });
  const Index most = most_in_range(graph.n);
  std::vector<Range> stack, closed;
  const auto keep = [&](const Range& r) {
    if (r.end - r.begin <= most) closed.push_back(r);
  };
  for (Index k = 0; k < graph.n; ++k) {
    std::size_t first = stack.size();  // of those that the new range takes in
    while (first > 0 && stack[first - 1].end > low[at(k)]) --first;
    const Range range{first < stack.size() ? stack[first].begin : k, k + 1};
    if (range.end - range.begin > most)
      std::for_each(stack.begin() + static_cast<std::ptrdiff_t>(first), stack.end(), keep);
    stack.resize(first);
    stack.push_back(range);
  }
  std::for_each(stack.begin(), stack.end(), keep);
  std::sort(closed.begin(), closed.end(), [](const Range& a, const Range& b) { return a.begin < b.begin; });
  std::vector<Range> out;  // neighbours are taken together while they are small
  for (const Range& r : closed)
    if (!out.empty() && out.back().end == r.begin && r.end - out.back().begin <= most)
      out.back().end = r.end;
    else
      out.push_back(r);
  return out;
}

/// The row sub-trees of the columns of L, counted by their leaves and the places where paths from them meet.
class ColumnCounter {
 public:
  ColumnCounter(const Graph& g, std::span<const Index> parent, std::span<const Index> weight)
      : g_(g),
        parent_(parent),
        weight_(weight),
        first_(parent.size()),
        set_(parent.size()),
        count_(parent.size(), 0),
        rows_(parent.size()) {}

  std::vector<Index> run(base::ThreadPool& pool);

 private:
  struct Row {
    Index max_first = -1, previous_leaf = -1;
  };
  /// A sub-tree that was counted alone: all rows outside that have leaves in it. For them it is one leaf, its root.
  struct SubTree {
    Index root;
    std::vector<Index> rows;
  };

  [[nodiscard]] std::vector<SubTree> cut(base::ThreadPool& pool);
  void count_alone(SubTree& tree, std::vector<Row>& outside);
  void count_root(const SubTree& tree);
  void count_column(Index j);
  void meet(Row& row, Index i, Index leaf);
  void leave(Index j);

  const Graph& g_;
  std::span<const Index> parent_, weight_;
  std::vector<Index> first_;  // the first descendant
  std::vector<Index> set_;    // where paths go on from vertices that are done
  std::vector<Index> count_;  // sums over row sub-trees: bounded by the number of unknowns
  std::vector<Row> rows_;
};

/// The largest sub-trees that are small enough, ascending.
std::vector<ColumnCounter::SubTree> ColumnCounter::cut(base::ThreadPool& pool) {
  const Index n = g_.n, most = most_in_range(n);
  std::iota(first_.begin(), first_.end(), 0);
  for (Index j = 0; j < n; ++j)
    if (parent_[at(j)] >= 0) first_[at(parent_[at(j)])] = std::min(first_[at(parent_[at(j)])], first_[at(j)]);
  pool.for_each_range(n, kTreeRange, [&](std::int64_t begin, std::int64_t end) {
    std::iota(set_.begin() + begin, set_.begin() + end, static_cast<Index>(begin));
    for (auto j = at(begin); j < at(end); ++j)
      if (first_[j] == static_cast<Index>(j)) count_[j] = weight_[j];  // a leaf of the tree
  });
  std::vector<SubTree> trees;
  const auto small = [&](Index j) { return j - first_[at(j)] < most; };
  for (Index j = 0; j < n; ++j)
    if (small(j) && (parent_[at(j)] < 0 || !small(parent_[at(j)]))) trees.push_back({j, {}});
  return trees;
}

/// `leaf` is a leaf of row i: its path meets that of the leaf before it.
void ColumnCounter::meet(Row& row, Index i, Index leaf) {
  row.max_first = first_[at(leaf)];
  const Index before = std::exchange(row.previous_leaf, leaf);
  if (before < 0) return;
  Index q = before;  // the least common ancestor of the two leaves
  while (q != set_[at(q)]) q = set_[at(q)];
  for (Index s = before; s != q;) s = std::exchange(set_[at(s)], q);
  count_[at(q)] -= weight_[at(i)];
}

void ColumnCounter::leave(Index j) {
  if (parent_[at(j)] >= 0) set_[at(j)] = parent_[at(j)];
}

void ColumnCounter::count_alone(SubTree& tree, std::vector<Row>& outside) {
  const Index begin = first_[at(tree.root)];
  for (Index j = begin; j <= tree.root; ++j) {
    if (j != tree.root) count_[at(parent_[at(j)])] -= weight_[at(j)];
    for (const Index i : g_.neighbours(j)) {
      Row& row = i > tree.root ? outside[at(i)] : rows_[at(i)];
      if (i < j || first_[at(j)] <= row.max_first) continue;  // not below the diagonal, or j is no leaf of row i
      if (i > tree.root && row.max_first < 0) tree.rows.push_back(i);
      count_[at(j)] += weight_[at(i)];
      meet(row, i, j);
    }
    if (j != tree.root) leave(j);
  }
  for (Index j = begin; j < tree.root; ++j) count_[at(parent_[at(j)])] += count_[at(j)];
  for (const Index i : tree.rows) outside[at(i)] = Row{};
}

void ColumnCounter::count_root(const SubTree& tree) {
  if (parent_[at(tree.root)] >= 0) count_[at(parent_[at(tree.root)])] -= weight_[at(tree.root)];
  for (const Index i : tree.rows) meet(rows_[at(i)], i, tree.root);
  leave(tree.root);
}

void ColumnCounter::count_column(Index j) {
  if (parent_[at(j)] >= 0) count_[at(parent_[at(j)])] -= weight_[at(j)];
  for (const Index i : g_.neighbours(j)) {
    Row& row = rows_[at(i)];
    if (i < j || first_[at(j)] <= row.max_first) continue;
    count_[at(j)] += weight_[at(i)];
    meet(row, i, j);
  }
  leave(j);
}

std::vector<Index> ColumnCounter::run(base::ThreadPool& pool) {
  std::vector<SubTree> trees = cut(pool);
  std::atomic<std::size_t> next{0};
  pool.share([&](int) {
    std::vector<Row> outside;
    for (;;) {
      constexpr std::size_t kTrees = 4;  // per draw: a forest has many tiny ones
      const std::size_t begin = next.fetch_add(kTrees);
      if (begin >= trees.size()) return;
      if (outside.empty()) outside.resize(parent_.size());
      for (std::size_t t = begin; t < std::min(trees.size(), begin + kTrees); ++t) count_alone(trees[t], outside);
    }
  });
  std::vector<Index> top;  // roots of sub-trees and what stands above them, ascending
  auto tree = trees.begin();
  for (Index j = 0; j < g_.n; ++j) {
    if (tree != trees.end() && first_[at(tree->root)] == j) {
      j = tree->root;
      count_root(*tree++);
    } else {
      count_column(j);
    }
    top.push_back(j);
  }
  for (const Index j : top)
    if (parent_[at(j)] >= 0) count_[at(parent_[at(j)])] += count_[at(j)];
  return std::move(count_);
}

}  // namespace

std::vector<Index> inverse(std::span<const Index> order, base::ThreadPool& pool) {
  std::vector<Index> position(order.size());
  pool.for_each_range(static_cast<std::int64_t>(order.size()), 8 * kTreeRange,
                      [&](std::int64_t begin, std::int64_t end) {
                        for (auto k = at(begin); k < at(end); ++k) position[at(order[k])] = static_cast<Index>(k);
                      });
  return position;
}

Graph permute(const Graph& graph, std::span<const Index> order, base::ThreadPool& pool) {
  const std::vector<Index> position = inverse(order, pool);
  Graph out{graph.n, std::vector<Offset>(order.size() + 1, 0), base::LazyVector<Index>(graph.adj.size())};
  for (std::size_t k = 0; k < order.size(); ++k)
    out.ptr[k + 1] = out.ptr[k] + static_cast<Offset>(graph.neighbours(order[k]).size());
  pool.for_each_range(graph.n, kTreeRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k) {
      Index* to = out.adj.data() + out.ptr[k];
      for (const Index u : graph.neighbours(order[k])) *to++ = position[at(u)];
    }
  });
  return out;
}

std::vector<Index> elimination_tree(const Graph& graph, std::span<const Index> order, base::ThreadPool& pool) {
  const std::vector<Index> position = inverse(order, pool);
  const std::vector<Range> ranges = closed_ranges(graph, order, position, pool);
  std::vector<Index> parent(order.size(), -1), ancestor(order.size(), -1);
  const auto add = [&](Range range) {
    for (Index k = range.begin; k < range.end; ++k)
      for (const Index u : graph.neighbours(order[at(k)])) {
        Index i = position[at(u)];
        while (i >= 0 && i < k) {  // climb from i to the root of its tree, pointing the path at k
          const Index next = ancestor[at(i)];
          ancestor[at(i)] = k;
          if (next < 0) parent[at(i)] = k;
          i = next;
        }
      }
  };
  pool.for_each(static_cast<std::int64_t>(ranges.size()), [&](std::int64_t r) { add(ranges[at(r)]); });
  Index done = 0;
  for (const Range& r : ranges) {
    add({done, r.begin});
    done = r.end;
  }
  add({done, graph.n});
  return parent;
}

std::vector<Index> postorder(std::span<const Index> parent) {
  const auto n = static_cast<Index>(parent.size());
  std::vector<Index> head(parent.size() + 1, -1), next(parent.size()), order;
  order.reserve(parent.size());
  for (Index k = n - 1; k >= 0; --k) {  // lists of children in rising order; the roots are the children of n
    const std::size_t p = parent[at(k)] < 0 ? parent.size() : at(parent[at(k)]);
    next[at(k)] = head[p];
    head[p] = k;
  }
  std::vector<Index> stack;
  for (Index root = head.back(); root >= 0; root = next[at(root)]) {
    stack.push_back(root);
    while (!stack.empty()) {
      const Index k = stack.back();
      const Index child = head[at(k)];
      if (child >= 0) {
        head[at(k)] = next[at(child)];
        stack.push_back(child);
      } else {
        order.push_back(k);
        stack.pop_back();
      }
    }
  }
  return order;
}

std::vector<Index> column_weights(const Graph& g, std::span<const Index> parent, std::span<const Index> weight,
                                  base::ThreadPool& pool) {
  return ColumnCounter(g, parent, weight).run(pool);
}

}  // namespace espalier::analysis
