#include "analysis/ordering/dissection.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>
#include <utility>

#include "analysis/ordering/approximate_degree.hpp"
#include "analysis/ordering/minimum_degree.hpp"
#include "analysis/ordering/separator.hpp"
#include "analysis/ordering/subgraphs.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

// Domains of at most so many vertices are ordered by minimum degree. Mean flops over six graphs against 60 vertices: 40
// -0.3 %, 120 +1.1 %, 200 +2.7 %; 60 takes a tenth more time than 120.
constexpr Index kLeaf = 60;
constexpr Index kFlatLeaf = 400;  // the same in parts of plane graphs: 500^2 a fifth less time, 3 % more flops
constexpr std::int64_t kDissectionRange = 1 << 13;  // per range of a loop
constexpr Index kHaloLimit = 2000;                  // a leaf with more vertices, halo included, goes without its halo
constexpr Index kDegreeFirst = 20000;               // larger graphs are ordered by minimum degree beside dissection

/// A part of the graph that is still to be ordered, and its places in the elimination order.
struct Domain {
  PartGraph graph;
  std::vector<Index> vertices;  // names in the whole graph
  bool flat = false;            // cut off by a separator as short as those of plane graphs
  Index begin = 0;              // it fills order[begin] .. order[begin + vertices.size() - 1]
  std::uint64_t seed = 0;
};

class Dissector {
 public:
  explicit Dissector(const CompressedGraph& whole)
      : whole_(whole), order_(whole.weight.size()), local_(whole.weight.size(), -1) {}

  Orders run(bool minimum_degree, base::ThreadPool& pool);

 private:
  using Task = std::shared_ptr<const Domain>;

  Domain without_dense_vertices(base::Recursion& recursion);
  void dissect(const Task& domain, base::Recursion& recursion);
  void bisect(const Task& domain, base::Recursion& recursion);
  void order_leaf(const Domain& domain);
  void write_order(const Domain& domain, std::span<const Index> order);
  void start(Domain domain, base::Recursion& recursion);
  [[nodiscard]] HaloGraph halo_graph(const Domain& domain);

  const CompressedGraph& whole_;
  std::vector<Index> order_;
  std::vector<Index> local_;  // the number of a vertex in its leaf; -1 before, and for ever in separators
};

/// Dense vertices go last: a vertex with very many neighbours sits in every separator anyway, and would make every
/// coarsening and refinement step slow. The bound is AMD's (Amestoy, Davis, Duff 2004), ten times the root of n.
Domain Dissector::without_dense_vertices(base::Recursion& recursion) {
  const Graph& g = whole_.graph;
  const double average = static_cast<double>(g.adj.size()) / std::max<Index>(1, g.n);
  const auto most = static_cast<Offset>(std::max({100.0, 10 * std::sqrt(static_cast<double>(g.n)), 20 * average}));
  std::vector<char> dense(at(g.n));
  recursion.for_each_range(g.n, kDissectionRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v)
      dense[at(v)] = static_cast<char>(static_cast<Offset>(g.neighbours(v).size()) > most);
  });
  std::vector<Index> place(at(g.n), -1);
  Domain all;
  all.seed = 1;
  all.vertices = members_of(dense, 0, place, recursion);
  all.graph = induced(g.ptr, g.adj, whole_.weight, all.vertices, place, recursion);
  std::size_t end = all.vertices.size();
  for (std::size_t v = 0; end < order_.size(); ++v)
    if (dense[v] != 0) order_[end++] = static_cast<Index>(v);
  return all;
}

void Dissector::start(Domain domain, base::Recursion& recursion) {
  auto task = std::make_shared<const Domain>(std::move(domain));
  if (task->graph.n() <= (task->flat ? kFlatLeaf : kLeaf)) return order_leaf(*task);
  recursion.spawn([this, task = std::move(task)](base::Recursion& r) mutable { dissect(task, r); });
}

/// The vertices `members` of a domain; `place` says where they stand there (see induced()).
Domain part_of(const Domain& domain, std::span<const Index> members, std::span<const Index> place,
               base::Recursion& recursion) {
  Domain part;
  part.graph = induced(domain.graph.ptr, domain.graph.adj, domain.graph.weight, members, place, recursion);
  part.vertices.resize(members.size());
  recursion.for_each_range(part.graph.n(), kDissectionRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k) part.vertices[k] = domain.vertices[at(members[k])];
  });
  return part;
}

void Dissector::dissect(const Task& domain, base::Recursion& recursion) {
  std::vector<Index> component;
  const Index count = components(domain->graph, component, recursion);
  if (count == 1) return bisect(domain, recursion);
  std::vector<Index> first(at(count) + 1, 0), members(component.size()), place(component.size());
  for (const Index c : component) ++first[at(c) + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<Index> next(first.begin(), first.end() - 1);
  for (std::size_t v = 0; v < component.size(); ++v) {
    const Index k = next[at(component[v])]++;
    members[at(k)] = static_cast<Index>(v);
    place[v] = k - first[at(component[v])];
  }
  for (Index c = 0; c < count; ++c) {
    const auto list = std::span(members).subspan(at(first[at(c)]), at(first[at(c) + 1] - first[at(c)]));
    const Index begin = domain->begin + first[at(c)];
    if (list.size() == 1) {
      order_[at(begin)] = domain->vertices[at(list[0])];
      continue;
    }
    Domain part = part_of(*domain, list, place, recursion);
    part.begin = begin;
    part.seed = Random(domain->seed + at(c)).next();
    part.flat = domain->flat;
    start(std::move(part), recursion);
  }
}

// Whether a separator is as short as in a plane graph. Parts of it are ordered nearly as well by minimum degree, in a
// fraction of the time; that pays where a vertex is one unknown, so that factors cost less than orders.
bool is_flat(const PartGraph& graph, const Separation& s) {
  constexpr double kFlat = 2;  // squared length over vertices; grids in a plane: 1, in space the cube root of n
  constexpr double kOneUnknown = 1.5;
  const double separator = static_cast<double>(s.weight[2]), total = static_cast<double>(graph.total), n = graph.n();
  return total <= kOneUnknown * n && separator * separator * n <= kFlat * total * total;
}

void Dissector::bisect(const Task& domain, base::Recursion& recursion) {
  const Separation s = find_separator(domain->graph, domain->seed, recursion);
  if (s.weight[0] == 0 || s.weight[1] == 0) return order_leaf(*domain);  // no separator: nearly complete
  const bool flat = is_flat(domain->graph, s);
  std::vector<Index> place(s.side.size(), -1);  // one for both sides: no edge joins them
  Index begin = domain->begin;
  const std::vector<Index> sides[2] = {members_of(s.side, 0, place, recursion),
                                       members_of(s.side, 1, place, recursion)};
  for (Index side = 0; side < 2; ++side) {
    Domain part = part_of(*domain, sides[side], place, recursion);
    part.begin = begin;
    part.seed = Random(domain->seed + at(side)).next();
    part.flat = flat;
    begin += part.graph.n();
    start(std::move(part), recursion);
  }
  for (Index v = 0; v < domain->graph.n(); ++v)
    if (s.side[at(v)] == 2) order_[at(begin++)] = domain->vertices[at(v)];
}

HaloGraph Dissector::halo_graph(const Domain& domain) {
  HaloGraph out;
  out.inner = domain.graph.n();
  out.weight = domain.graph.weight;
  for (Index k = 0; k < out.inner; ++k) local_[at(domain.vertices[at(k)])] = k;
  std::vector<Index> halo;
  for (const Index v : domain.vertices)
    for (const Index u : whole_.graph.neighbours(v))
      if (local_[at(u)] < 0) halo.push_back(u);
  std::sort(halo.begin(), halo.end());
  halo.erase(std::unique(halo.begin(), halo.end()), halo.end());
  if (static_cast<Index>(halo.size()) + out.inner > kHaloLimit) halo.clear();
  for (const Index u : halo) out.weight.push_back(whole_.weight[at(u)]);
  out.ptr.push_back(0);
  for (const Index v : domain.vertices) {
    for (const Index u : whole_.graph.neighbours(v))
      if (local_[at(u)] >= 0) {
        out.adj.push_back(local_[at(u)]);
      } else if (!halo.empty()) {
        out.adj.push_back(out.inner + static_cast<Index>(std::lower_bound(halo.begin(), halo.end(), u) - halo.begin()));
      }
    out.ptr.push_back(static_cast<Index>(out.adj.size()));
  }
  return out;
}

// The same with rows for the halo.
PartGraph with_halo(const HaloGraph& g) {
  PartGraph out;
  const std::size_t n = g.weight.size();
  out.weight = g.weight;
  out.total = std::accumulate(g.weight.begin(), g.weight.end(), Offset{0});
  std::vector<Offset> next(n + 1, 0);
  for (const Index u : g.adj)
    if (u >= g.inner) ++next[at(u) + 1];
  for (Index v = 0; v < g.inner; ++v) next[at(v) + 1] = g.ptr[at(v) + 1] - g.ptr[at(v)];
  std::partial_sum(next.begin(), next.end(), next.begin());
  out.ptr = next;
  out.adj.resize(at(out.ptr.back()));
  for (Index v = 0; v < g.inner; ++v)
    for (Index k = g.ptr[at(v)]; k < g.ptr[at(v) + 1]; ++k) {
      const Index u = g.adj[at(k)];
      out.adj[at(next[at(v)]++)] = u;
      if (u >= g.inner) out.adj[at(next[at(u)]++)] = v;
    }
  return out;
}

void Dissector::order_leaf(const Domain& domain) {
  if (domain.graph.n() > kHaloLimit || domain.graph.adj.empty()) {
    std::copy(domain.vertices.begin(), domain.vertices.end(), order_.begin() + domain.begin);
    return;
  }
  const HaloGraph graph = halo_graph(domain);
  if (domain.flat && graph.inner > kLeaf) {
    const MinimumDegreeOrder order = approximate_minimum_degree(with_halo(graph), graph.inner);
    if (!order.order.empty()) return write_order(domain, order.order);
  }
  write_order(domain, minimum_degree(graph));
}

void Dissector::write_order(const Domain& domain, std::span<const Index> order) {
  for (std::size_t k = 0; k < order.size(); ++k) order_[at(domain.begin) + k] = domain.vertices[at(order[k])];
}

Orders Dissector::run(bool minimum_degree, base::ThreadPool& pool) {
  Orders out;
  Task root;
  MinimumDegreeOrder other;
  bool enough = false;
  base::Recursion::run(pool, [&](base::Recursion& r) {
    root = std::make_shared<const Domain>(without_dense_vertices(r));
    const Index n = root->graph.n();
    if (n == 0) return;
    if (minimum_degree && n <= kDegreeFirst) {
      other = approximate_minimum_degree(root->graph);
      enough = minimum_degree_will_do(other, n, root->graph.total);
      if (enough) return;
    } else if (minimum_degree) {
      r.spawn([&other, root](base::Recursion&) { other = approximate_minimum_degree(root->graph); });
    }
    dissect(root, r);
  });
  if (!other.order.empty()) {
    out.minimum_degree = order_;  // the dense vertices
    for (std::size_t k = 0; k < other.order.size(); ++k) out.minimum_degree[k] = root->vertices[at(other.order[k])];
    out.minimum_degree_flops = other.flops;
  }
  if (!enough) out.dissection = std::move(order_);
  return out;
}

}  // namespace

// Measured on 170 graphs (docs/design/analysis.md). The weight of the largest front, squared, over that of the graph,
// squared, times its vertices: grids in a plane 2 to 4, in space 7 (5^3) to 34 (12^3).
bool minimum_degree_will_do(const MinimumDegreeOrder& order, Index vertices, Offset weight) {
  constexpr Index kLeast = 256;   // a smaller graph is dissected in no time
  constexpr Index kSmall = 3000;  // vertices up to which dissection never gains much in a plane
  constexpr double kFewFlops = 1500, kFewOfSmall = 11000;  // for each vertex
  constexpr double kPlane = 4.1;
  if (order.order.empty() || vertices < kLeast) return false;
  if (order.flops > (vertices <= kSmall ? kFewOfSmall : kFewFlops) * vertices) return false;
  const double front = static_cast<double>(order.largest) / static_cast<double>(weight);
  return front * front * vertices <= kPlane;
}

Orders fill_reducing_orders(const CompressedGraph& graph, bool minimum_degree, base::ThreadPool& pool) {
  return Dissector(graph).run(minimum_degree, pool);
}

std::vector<Index> nested_dissection(const CompressedGraph& graph, base::ThreadPool& pool) {
  return fill_reducing_orders(graph, false, pool).dissection;
}

}  // namespace espalier::analysis
