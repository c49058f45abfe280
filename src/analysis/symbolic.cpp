#include "analysis/symbolic.hpp"

#include <algorithm>
#include <utility>

#include "analysis/elimination_tree.hpp"
#include "analysis/fronts.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

constexpr std::int64_t kSymbolicRange = 1 << 14;  // per range of a loop

/// Fronts of vertices -> fronts of unknowns. @param graph vertex k goes k-th in the order that `tree` refines
AssemblyTree expand(const CompressedGraph& compressed, std::span<const Index> order, const Graph& graph,
                    const FrontTree& tree, base::ThreadPool& pool) {
  AssemblyTree out;
  out.n = compressed.member_ptr.back();
  out.parent = tree.parent;
  out.order.resize(compressed.members.size());
  std::vector<Index> begin(order.size() + 1, 0);  // first position of each vertex in elimination order
  for (std::size_t k = 0; k < order.size(); ++k)
    begin[k + 1] = begin[k] + compressed.weight[at(order[at(tree.order[k])])];
  pool.for_each_range(graph.n, kSymbolicRange, [&](std::int64_t from, std::int64_t to) {
    for (auto k = at(from); k < at(to); ++k) {
      const std::size_t v = at(order[at(tree.order[k])]);
      std::copy_n(compressed.members.begin() + compressed.member_ptr[v], compressed.weight[v],
                  out.order.begin() + begin[k]);
    }
  });
  const auto fronts = at(tree.fronts());
  out.first.resize(fronts + 1);
  out.row_ptr.assign(fronts + 1, 0);
  for (std::size_t f = 0; f <= fronts; ++f) out.first[f] = begin[at(tree.first[f])];
  for (std::size_t f = 0; f < fronts; ++f) out.row_ptr[f + 1] = out.row_ptr[f] + tree.below[f];
  out.rows.resize(at(out.row_ptr.back()));
  const std::vector<Index> vertices = front_rows(graph, tree, out.row_ptr, out.rows, pool);
  pool.for_each_range(tree.fronts(), 256, [&](std::int64_t from, std::int64_t to) {
    for (auto f = at(from); f < at(to); ++f) {
      Index* const rows = out.rows.data() + out.row_ptr[f];
      Index* end = rows + tree.below[f];
      for (Index k = vertices[f]; k-- > 0;) {  // in place, last first: a vertex has at least one unknown
        const Index v = rows[k];
        for (Index p = begin[at(v) + 1]; p-- > begin[at(v)];) *--end = p;
      }
    }
  });
  return out;
}

void count(const FrontTree& tree, double& entries, double& flops) {
  for (Index f = 0; f < tree.fronts(); ++f) {
    entries += front_entries(tree.width[at(f)], tree.below[at(f)]);
    flops += front_flops(tree.width[at(f)], tree.below[at(f)]);
  }
}

std::vector<Index> gather(std::span<const Index> values, std::span<const Index> order, base::ThreadPool& pool) {
  std::vector<Index> out(order.size());
  pool.for_each_range(static_cast<std::int64_t>(order.size()), kSymbolicRange,
                      [&](std::int64_t begin, std::int64_t end) {
                        for (auto k = at(begin); k < at(end); ++k) out[k] = values[at(order[k])];
                      });
  return out;
}

}  // namespace

AssemblyTree symbolic_tree(const CompressedGraph& graph, std::vector<Index> order, base::ThreadPool& pool,
                           TreeStatistics& statistics) {
  std::vector<Index> parent = elimination_tree(graph.graph, order, pool);
  const std::vector<Index> post = postorder(parent);
  const std::vector<Index> place = inverse(post, pool);
  order = gather(order, post, pool);
  parent = gather(parent, post, pool);
  for (Index& p : parent)
    if (p >= 0) p = place[at(p)];
  const Graph permuted = permute(graph.graph, order, pool);
  const std::vector<Index> weight = gather(graph.weight, order, pool);
  const std::vector<Index> columns = column_weights(permuted, parent, weight, pool);
  const FrontTree exact = fundamental_supernodes(parent, weight, columns);
  double entries = 0;
  count(exact, entries, statistics.flops_exact);
  const FrontTree tree = amalgamate(exact, AmalgamationCost{});
  entries = 0;
  count(tree, entries, statistics.flops);
  statistics.nonzeros_factor = static_cast<Offset>(entries);
  return expand(graph, order, permuted, tree, pool);
}

}  // namespace espalier::analysis
