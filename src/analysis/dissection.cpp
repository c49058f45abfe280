#include "analysis/dissection.hpp"

#include <metis.h>

#include <numeric>

namespace espalier::analysis {

std::vector<Index> nested_dissection(const CompressedGraph& graph, base::ThreadPool&) {
  const Graph& g = graph.graph;
  std::vector<Index> order(graph.weight.size());
  std::iota(order.begin(), order.end(), 0);
  if (g.adj.empty()) return order;
  std::vector<idx_t> ptr(g.ptr.begin(), g.ptr.end()), adj(g.adj.begin(), g.adj.end());
  std::vector<idx_t> weight(graph.weight.begin(), graph.weight.end()), position(order.size());
  idx_t n = g.n;
  METIS_NodeND(&n, ptr.data(), adj.data(), weight.data(), nullptr, order.data(), position.data());
  return order;
}

}  // namespace espalier::analysis
