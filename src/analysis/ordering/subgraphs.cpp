#include "analysis/ordering/subgraphs.hpp"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <utility>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

constexpr std::int64_t kSubgraphRange = 1 << 13;  // per range of a loop: small graphs are one range

std::size_t ranges_of(std::size_t n) { return (n + at(kSubgraphRange) - 1) / at(kSubgraphRange); }

/// Trees of vertices that are known to be connected; the root is the lowest vertex. Any thread may join two.
class Forest {
 public:
  explicit Forest(Index n) : parent_(at(n)) { std::iota(parent_.begin(), parent_.end(), 0); }

  /// The root of v's tree as far as it is known now; halves the path.
  Index root(Index v) {
    for (;;) {
      const Index p = load(v);
      if (p == v) return v;
      const Index above = load(p);
      if (above == p) return p;
      Index expected = p;
      std::atomic_ref<Index>(parent_[at(v)]).compare_exchange_weak(expected, above, std::memory_order_relaxed);
      v = above;
    }
  }
  void join(Index u, Index v) {
    for (;;) {
      u = root(u);
      v = root(v);
      if (u == v) return;
      if (u > v) std::swap(u, v);
      Index expected = v;  // the higher root becomes a child of the lower one, so no circle can close
      if (std::atomic_ref<Index>(parent_[at(v)]).compare_exchange_strong(expected, u, std::memory_order_relaxed))
        return;
    }
  }

 private:
  Index load(Index v) { return std::atomic_ref<Index>(parent_[at(v)]).load(std::memory_order_relaxed); }
  std::vector<Index> parent_;
};

/// The root that most of a few vertices have.
Index frequent_root(Forest& forest, Index n) {
  constexpr Index kSamples = 32;
  std::vector<Index> roots;
  for (Index k = 0; k < kSamples; ++k) roots.push_back(forest.root(static_cast<Index>(Offset{k} * n / kSamples)));
  std::sort(roots.begin(), roots.end());
  Index best = roots.front();
  std::ptrdiff_t most = 0;
  for (auto b = roots.begin(); b != roots.end();) {
    const auto e = std::upper_bound(b, roots.end(), *b);
    if (e - b > most) {
      most = e - b;
      best = *b;
    }
    b = e;
  }
  return best;
}

}  // namespace

PartGraph induced(std::span<const Offset> ptr, std::span<const Index> adj, std::span<const Index> weight,
                  std::span<const Index> members, std::span<const Index> place, base::Recursion& workers) {
  PartGraph out;
  const auto size = static_cast<std::int64_t>(members.size());
  out.ptr.resize(members.size() + 1);
  out.weight.resize(members.size());
  std::vector<Offset> edges(ranges_of(members.size()) + 1, 0), total(edges.size(), 0);  // before each range
  const auto each_neighbour = [&](std::size_t k, const auto& use) {
    for (Offset e = ptr[at(members[k])]; e < ptr[at(members[k]) + 1]; ++e)
      if (const Index u = place[at(adj[at(e)])]; u >= 0) use(u);
  };
  workers.for_each_range(size, kSubgraphRange, [&](std::int64_t begin, std::int64_t end) {
    Offset count = 0, sum = 0;
    for (auto k = at(begin); k < at(end); ++k) {
      each_neighbour(k, [&](Index) { ++count; });
      out.ptr[k + 1] = count;
      sum += out.weight[k] = weight[at(members[k])];
    }
    edges[at(begin / kSubgraphRange) + 1] = count;
    total[at(begin / kSubgraphRange) + 1] = sum;
  });
  std::partial_sum(edges.begin(), edges.end(), edges.begin());
  out.total = std::accumulate(total.begin(), total.end(), Offset{0});
  out.adj.resize(at(edges.back()));
  out.edge.resize(out.adj.size());
  workers.for_each_range(size, kSubgraphRange, [&](std::int64_t begin, std::int64_t end) {
    const Offset first = edges[at(begin / kSubgraphRange)];
    Offset next = first;
    for (auto k = at(begin); k < at(end); ++k) {
      each_neighbour(k, [&](Index u) { out.adj[at(next++)] = u; });
      out.ptr[k + 1] += first;
    }
    std::fill(out.edge.begin() + first, out.edge.begin() + next, 1);
  });
  return out;
}

std::vector<Index> members_of(std::span<const char> pick, char which, std::span<Index> place,
                              base::Recursion& workers) {
  const auto n = static_cast<std::int64_t>(pick.size());
  std::vector<Index> first(ranges_of(pick.size()) + 1, 0);
  workers.for_each_range(n, kSubgraphRange, [&](std::int64_t begin, std::int64_t end) {
    first[at(begin / kSubgraphRange) + 1] =
        static_cast<Index>(std::count(pick.begin() + begin, pick.begin() + end, which));
  });
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<Index> members(at(first.back()));
  workers.for_each_range(n, kSubgraphRange, [&](std::int64_t begin, std::int64_t end) {
    Index k = first[at(begin / kSubgraphRange)];
    for (auto v = at(begin); v < at(end); ++v) {
      if (pick[v] != which) continue;
      members[at(k)] = static_cast<Index>(v);
      place[v] = k++;
    }
  });
  return members;
}

// Two edges of every vertex join nearly everything; after that only vertices outside the largest component need to show
// the rest of theirs (Sutton, Ben-Nun, Barak 2018). The components do not depend on the order of the joins.
Index components(const PartGraph& g, std::vector<Index>& component, base::Recursion& workers) {
  constexpr Offset kFirst = 2;
  const Index n = g.n();
  if (n == 0) return 0;
  Forest forest(n);
  workers.for_each_range(n, kSubgraphRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v)
      for (Offset e = g.ptr[at(v)]; e < std::min(g.ptr[at(v)] + kFirst, g.ptr[at(v) + 1]); ++e)
        forest.join(v, g.adj[at(e)]);
  });
  const Index largest = frequent_root(forest, n);
  workers.for_each_range(n, kSubgraphRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v) {
      if (forest.root(v) == forest.root(largest)) continue;
      for (Offset e = g.ptr[at(v)] + kFirst; e < g.ptr[at(v) + 1]; ++e) forest.join(v, g.adj[at(e)]);
    }
  });
  component.resize(at(n));
  std::atomic<bool> several{false};
  workers.for_each_range(n, kSubgraphRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v)
      if ((component[at(v)] = forest.root(v)) != 0) several.store(true, std::memory_order_relaxed);
  });
  if (!several) return 1;
  Index count = 0;  // a root is the lowest vertex of its component, so it has its number before the others ask for it
  for (Index v = 0; v < n; ++v) component[at(v)] = component[at(v)] == v ? count++ : component[at(component[at(v)])];
  return count;
}

}  // namespace espalier::analysis
