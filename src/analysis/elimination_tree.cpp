#include "analysis/elimination_tree.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace espalier::analysis {

namespace {
auto at(Index k) { return static_cast<std::size_t>(k); }
}  // namespace

std::vector<Index> inverse(std::span<const Index> order) {
  std::vector<Index> position(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) position[at(order[k])] = static_cast<Index>(k);
  return position;
}

Graph permute(const Graph& graph, std::span<const Index> order, base::ThreadPool& pool) {
  constexpr std::int64_t kVertices = 4096;
  const std::vector<Index> position = inverse(order);
  Graph out{graph.n, std::vector<Offset>(order.size() + 1, 0), LazyVector<Index>(graph.adj.size())};
  for (std::size_t k = 0; k < order.size(); ++k)
    out.ptr[k + 1] = out.ptr[k] + static_cast<Offset>(graph.neighbours(order[k]).size());
  pool.for_each_piece(graph.n, kVertices, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      Index* to = out.adj.data() + out.ptr[k];
      for (const Index u : graph.neighbours(order[k])) *to++ = position[at(u)];
    }
  });
  return out;
}

std::vector<Index> elimination_tree(const Graph& graph, std::span<const Index> order) {
  const std::vector<Index> position = inverse(order);
  std::vector<Index> parent(order.size(), -1), ancestor(order.size(), -1);
  for (Index k = 0; k < graph.n; ++k)
    for (const Index u : graph.neighbours(order[at(k)])) {
      Index i = position[at(u)];
      while (i >= 0 && i < k) {  // climb from i to the root of its tree, pointing the path at k
        const Index next = ancestor[at(i)];
        ancestor[at(i)] = k;
        if (next < 0) parent[at(i)] = k;
        i = next;
      }
    }
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

std::vector<Index> column_weights(const Graph& g, std::span<const Index> parent, std::span<const Index> weight) {
  const std::size_t n = parent.size();
  std::vector<Index> first(n, -1), max_first(n, -1), previous_leaf(n, -1), set(n);
  std::vector<Index> count(n, 0);  // sums over row sub-trees: bounded by the number of unknowns
  for (Index k = 0; k < g.n; ++k) {
    if (first[at(k)] < 0) count[at(k)] = weight[at(k)];  // a leaf of the tree
    for (Index j = k; j >= 0 && first[at(j)] < 0; j = parent[at(j)]) first[at(j)] = k;
  }
  std::iota(set.begin(), set.end(), 0);
  for (Index j = 0; j < g.n; ++j) {
    if (parent[at(j)] >= 0) count[at(parent[at(j)])] -= weight[at(j)];
    for (const Index i : g.neighbours(j)) {
      if (i < j || first[at(j)] <= max_first[at(i)]) continue;  // not below the diagonal, or j is no leaf of row i
      max_first[at(i)] = first[at(j)];
      count[at(j)] += weight[at(i)];
      const Index before = std::exchange(previous_leaf[at(i)], j);
      if (before < 0) continue;
      Index q = before;  // the least common ancestor of the two leaves
      while (q != set[at(q)]) q = set[at(q)];
      for (Index s = before; s != q;) s = std::exchange(set[at(s)], q);
      count[at(q)] -= weight[at(i)];
    }
    if (parent[at(j)] >= 0) set[at(j)] = parent[at(j)];
  }
  for (Index j = 0; j < g.n; ++j)
    if (parent[at(j)] >= 0) count[at(parent[at(j)])] += count[at(j)];
  return count;
}

}  // namespace espalier::analysis
