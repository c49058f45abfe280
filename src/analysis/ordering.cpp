#include "analysis/ordering.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <numeric>

#include "analysis/dissection.hpp"
#include "analysis/elimination_tree.hpp"
#include "analysis/symbolic.hpp"

namespace espalier::analysis {

namespace {

auto at(Index k) { return static_cast<std::size_t>(k); }

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

}  // namespace

AssemblyTree build_tree(const Graph& graph, const TreeOptions& options, base::ThreadPool& pool,
                        TreeStatistics* statistics) {
  TreeStatistics mine;
  const double start = seconds_now();
  CompressedGraph compressed;
  std::vector<Index> order;
  if (options.permutation.empty()) {
    compressed = compress(graph, options.pair, pool);
    order = nested_dissection(compressed, pool);
    if (!options.zero_diagonal.empty())
      order = postpone_multipliers(compressed, options.zero_diagonal, std::move(order), pool);
  } else {
    const std::vector<Index> position = checked_inverse(options.permutation, graph.n);
    compressed = compress_pairs(graph, options.pair, pool);
    order = order_by_last_member(compressed, position);
  }
  const double ordered = seconds_now();
  AssemblyTree tree = symbolic_tree(compressed, std::move(order), pool, mine);
  mine.ordering_seconds = ordered - start;
  mine.symbolic_seconds = seconds_now() - ordered;
  if (statistics != nullptr) *statistics = mine;
  return tree;
}

}  // namespace espalier::analysis
