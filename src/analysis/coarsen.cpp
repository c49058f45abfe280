#include "analysis/coarsen.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

namespace espalier::analysis {

namespace {

auto at(Index k) { return static_cast<std::size_t>(k); }
auto at(Offset k) { return static_cast<std::size_t>(k); }

/// The vertices in random order, then stably by degree (degrees above the average count as equal).
std::vector<Index> visiting_order(const PartGraph& g, Random& random) {
  const Index n = g.n();
  std::vector<Index> shuffled(at(n));
  std::iota(shuffled.begin(), shuffled.end(), 0);
  for (Index k = n - 1; k > 0; --k) std::swap(shuffled[at(k)], shuffled[at(random.below(k + 1))]);
  const Offset average = g.ptr.back() / std::max<Index>(1, n) + 1;
  const auto key = [&](Index v) { return at(std::min(average, g.ptr[at(v) + 1] - g.ptr[at(v)])); };
  std::vector<Index> count(at(average) + 2, 0);
  for (Index v = 0; v < n; ++v) ++count[key(v) + 1];
  std::partial_sum(count.begin(), count.end(), count.begin());
  std::vector<Index> order(at(n));
  for (const Index v : shuffled) order[at(count[key(v)]++)] = v;
  return order;
}

/// mate[v]: the vertex that v is contracted with, itself for none.
std::vector<Index> match(const PartGraph& g, Offset most_weight, Random& random) {
  std::vector<Index> mate(at(g.n()), -1);
  for (const Index v : visiting_order(g, random)) {
    if (mate[at(v)] >= 0) continue;
    Index best = v, heaviest = 0;
    for (Offset k = g.ptr[at(v)]; k < g.ptr[at(v) + 1]; ++k) {
      const Index u = g.adj[at(k)];
      if (g.edge[at(k)] <= heaviest || mate[at(u)] >= 0) continue;
      if (Offset{g.weight[at(u)]} + g.weight[at(v)] > most_weight) continue;
      heaviest = g.edge[at(k)];
      best = u;
    }
    mate[at(v)] = best;
    mate[at(best)] = v;
  }
  return mate;
}

}  // namespace

Coarser coarsen(const PartGraph& g, Offset most_weight, Random& random) {
  const std::vector<Index> mate = match(g, most_weight, random);
  Coarser out;
  out.map.resize(at(g.n()));
  Index coarse = 0;
  for (Index v = 0; v < g.n(); ++v)
    if (v <= mate[at(v)]) out.map[at(v)] = out.map[at(mate[at(v)])] = coarse++;
  PartGraph& c = out.graph;
  c.total = g.total;
  c.weight.resize(at(coarse));
  c.ptr.resize(at(coarse) + 1);
  c.adj.resize(g.adj.size());
  c.edge.resize(g.adj.size());
  std::vector<Offset> slot(at(coarse), -1);  // where the edge to a coarse vertex stands in the list being made
  Offset size = 0;
  for (Index v = 0, k = 0; v < g.n(); ++v) {
    if (v > mate[at(v)]) continue;
    const Offset begin = size;
    const auto append = [&](Index part) {
      for (Offset e = g.ptr[at(part)]; e < g.ptr[at(part) + 1]; ++e) {
        const Index to = out.map[at(g.adj[at(e)])];
        if (to == k) continue;
        if (slot[at(to)] >= begin) {
          c.edge[at(slot[at(to)])] += g.edge[at(e)];
        } else {
          slot[at(to)] = size;
          c.adj[at(size)] = to;
          c.edge[at(size++)] = g.edge[at(e)];
        }
      }
    };
    append(v);
    c.weight[at(k)] = g.weight[at(v)];
    if (mate[at(v)] != v) {
      append(mate[at(v)]);
      c.weight[at(k)] += g.weight[at(mate[at(v)])];
    }
    c.ptr[at(++k)] = size;
  }
  c.adj.resize(at(size));
  c.edge.resize(at(size));
  c.ptr[0] = 0;
  return out;
}

}  // namespace espalier::analysis
