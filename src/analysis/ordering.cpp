#include "analysis/ordering.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <numeric>

#include "analysis/elimination_tree.hpp"
#include "analysis/fronts.hpp"
#include "analysis/ordering/dissection.hpp"
#include "analysis/symbolic.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// position[v] of the caller's elimination order. @throws Error(invalid_input)
std::vector<Index> checked_inverse(std::span<const Index> permutation, Index n) {
  if (permutation.size() != at(n))
    throw Error(StatusCode::invalid_input,
                fmt::format("the permutation has {} entries, the matrix {} columns; give one "
                            "entry per column",
                            permutation.size(), n));
  std::vector<Index> position(at(n), -1);
  for (Index k = 0; k < n; ++k) {
    const Index v = permutation[at(k)];
    if (v < 0 || v >= n || position[at(v)] >= 0)
      throw Error(StatusCode::invalid_input,
                  fmt::format("entry {} of the permutation is {}, which is {}; the entries must "
                              "be 0 .. {} in any order, each once",
                              k, v, v < 0 || v >= n ? "out of range" : "there already", n - 1),
                  v);
    position[at(v)] = k;
  }
  return position;
}

/// The vertices by the last place that one of their unknowns has in the caller's order.
std::vector<Index> order_by_last_member(const CompressedGraph& graph, std::span<const Index> position) {
  std::vector<Index> last(graph.weight.size()), order(graph.weight.size());
  for (std::size_t v = 0; v < last.size(); ++v)
    for (Index k = graph.member_ptr[v]; k < graph.member_ptr[v + 1]; ++k)
      last[v] = std::max(last[v], position[at(graph.members[at(k)])]);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return last[at(a)] < last[at(b)]; });
  return order;
}

/// A vertex whose unknowns all have a zero diagonal is a multiplier: it is moved behind the last of its neighbours that
/// are none, so that their elimination has filled its diagonal.
std::vector<Index> postpone_multipliers(const CompressedGraph& graph, std::span<const char> zero_diagonal,
                                        std::vector<Index> order, base::ThreadPool& pool) {
  std::vector<char> multiplier(order.size(), 1);
  for (std::size_t v = 0; v < order.size(); ++v)
    for (Index k = graph.member_ptr[v]; k < graph.member_ptr[v + 1]; ++k)
      if (zero_diagonal[at(graph.members[at(k)])] == 0) multiplier[v] = 0;
  const std::vector<Index> position = inverse(order, pool);
  // Twice the place of the last neighbour plus one: behind it, before whatever follows it.
  std::vector<std::int64_t> key(order.size());
  for (std::size_t v = 0; v < order.size(); ++v) {
    key[v] = 2 * std::int64_t{position[v]};
    if (multiplier[v] == 0) continue;
    for (const Index u : graph.graph.neighbours(static_cast<Index>(v)))
      if (multiplier[at(u)] == 0) key[v] = std::max(key[v], 2 * std::int64_t{position[at(u)]} + 1);
  }
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return key[at(a)] < key[at(b)]; });
  return order;
}

// Dissection serves meshes; irregular systems, as those of optimisers are, often fill up less by minimum degree, which
// costs little beside it. It is worth a try where multipliers or pairs say that the matrix is no mesh's, where it is
// small, or where a vertex is one unknown with few neighbours, as in a plane.
bool tries_minimum_degree(const CompressedGraph& graph, const TreeOptions& options) {
  constexpr Index kSmall = 3000, kSparse = 20000, kMost = 300000;
  constexpr Index kFewNeighbours = 8;
  const Index n = graph.graph.n;
  const bool irregular = !options.pair.empty() || !options.zero_diagonal.empty();
  const bool sparse = static_cast<Offset>(graph.graph.adj.size()) <= Offset{kFewNeighbours} * n &&
                      2 * static_cast<Offset>(graph.members.size()) <= 3 * Offset{n};
  return n <= (irregular ? kMost : sparse ? kSparse : kSmall);
}

/// A front costs something besides its flops.
struct TreeWork {
  double all = 0;
  double critical = 0;  ///< on the longest path from a leaf to a root: what no number of threads can shorten
};

TreeWork work_of(const AssemblyTree& tree) {
  constexpr double kFront = 5e4;  // flops: some microseconds
  TreeWork work;
  std::vector<double> path(at(tree.fronts()), 0);
  for (Index f = 0; f < tree.fronts(); ++f) {
    const double mine = kFront + front_flops(tree.pivots(f), tree.rows_below(f));
    work.all += mine;
    path[at(f)] += mine;
    work.critical = std::max(work.critical, path[at(f)]);
    if (const Index up = tree.parent[at(f)]; up >= 0) path[at(up)] = std::max(path[at(up)], path[at(f)]);
  }
  return work;
}

/// Graphs of a plane have 0.1 to 0.45 of their work on the longest path, chains more than 0.6.
bool is_broad(const AssemblyTree& tree) {
  constexpr double kBroad = 0.5;
  const TreeWork work = work_of(tree);
  return work.critical <= kBroad * work.all;
}

/// The tree of the order with fewer flops. That of dissection is the broader one, which more threads can share: the
/// other one has to be clearly better, and no chain (a control problem of 1,000 steps: half of the flops, but one front
/// after another, twenty times as long on two threads of a busy machine).
AssemblyTree better_tree(const CompressedGraph& compressed, const TreeOptions& options, base::ThreadPool& pool,
                         TreeStatistics& statistics) {
  constexpr double kClearly = 0.93;
  const double start = seconds_now();
  Orders orders = fill_reducing_orders(compressed, tries_minimum_degree(compressed, options), pool);
  const auto tree_of = [&](std::vector<Index> order, TreeStatistics& of) {
    if (!options.zero_diagonal.empty())
      order = postpone_multipliers(compressed, options.zero_diagonal, std::move(order), pool);
    return symbolic_tree(compressed, std::move(order), pool, of);
  };
  statistics.ordering_seconds = seconds_now() - start;
  if (orders.dissection.empty()) {
    AssemblyTree tree = tree_of(orders.minimum_degree, statistics);
    if (is_broad(tree)) return tree;
    orders.dissection = nested_dissection(compressed, pool);
    statistics = {};
    statistics.ordering_seconds = seconds_now() - start;
  }
  AssemblyTree tree = tree_of(std::move(orders.dissection), statistics);
  if (orders.minimum_degree.empty() || orders.minimum_degree_flops > kClearly * statistics.flops_exact) return tree;
  TreeStatistics other;
  other.ordering_seconds = statistics.ordering_seconds;
  AssemblyTree second = tree_of(std::move(orders.minimum_degree), other);
  if (other.flops > kClearly * statistics.flops || work_of(second).critical > work_of(tree).critical) return tree;
  statistics = other;
  return second;
}

}  // namespace

AssemblyTree build_tree(const Graph& graph, const TreeOptions& options, base::ThreadPool& pool,
                        TreeStatistics* statistics) {
  TreeStatistics mine;
  const double start = seconds_now();
  CompressedGraph compressed;
  std::vector<Index> order;
  AssemblyTree tree;
  if (options.permutation.empty()) {
    compressed = compress(graph, options.pair, pool);
    const double compressing = seconds_now() - start;
    tree = better_tree(compressed, options, pool, mine);
    mine.ordering_seconds += compressing;
  } else {
    const std::vector<Index> position = checked_inverse(options.permutation, graph.n);
    compressed = compress_pairs(graph, options.pair, pool);
    order = order_by_last_member(compressed, position);
    mine.ordering_seconds = seconds_now() - start;
    tree = symbolic_tree(compressed, std::move(order), pool, mine);
  }
  mine.symbolic_seconds = seconds_now() - start - mine.ordering_seconds;
  if (statistics != nullptr) *statistics = mine;
  return tree;
}

}  // namespace espalier::analysis
