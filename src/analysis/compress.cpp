#include <algorithm>
#include <atomic>
#include <cstdint>
#include <numeric>
#include <utility>

#include "analysis/ordering/graph.hpp"
#include "base/at.hpp"
#include "base/mix.hpp"

namespace espalier::analysis {

namespace {

constexpr std::int64_t kCompressRange = 2048;  // vertices per range of a parallel loop

std::uint64_t hash_of(Index v) { return base::mix((static_cast<std::uint64_t>(v) + 1) * 0x9e3779b97f4a7c15ULL); }

/// Vertices that are their own leaders, numbered in rising order; -1 for the others.
struct Numbering {
  std::vector<Index> number;   ///< n
  std::vector<Index> leaders;  ///< one per group
};

Numbering number_leaders(std::span<const Index> leader, base::ThreadPool& pool) {
  const auto n = static_cast<std::int64_t>(leader.size());
  std::vector<Index> first(at((n + kCompressRange - 1) / kCompressRange) + 1,
                           0);  // before each range
  const auto leads = [&](std::int64_t v) { return leader[at(v)] == static_cast<Index>(v); };
  pool.for_each_range(n, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    Index count = 0;
    for (std::int64_t v = begin; v < end; ++v) count += leads(v) ? 1 : 0;
    first[at(begin / kCompressRange) + 1] = count;
  });
  std::partial_sum(first.begin(), first.end(), first.begin());
  Numbering out;
  out.number.resize(leader.size());
  out.leaders.resize(at(first.back()));
  pool.for_each_range(n, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    Index next = first[at(begin / kCompressRange)];
    for (std::int64_t v = begin; v < end; ++v) {
      out.number[at(v)] = leads(v) ? next : -1;
      if (leads(v)) out.leaders[at(next++)] = static_cast<Index>(v);
    }
  });
  return out;
}

/// Fills weight, member_ptr and members from the leader of each vertex; members rise within a vertex.
void list_members(std::span<const Index> leader, const Numbering& numbering, base::ThreadPool& pool,
                  CompressedGraph& out) {
  const std::size_t vertices = numbering.leaders.size();
  const auto n = static_cast<std::int64_t>(leader.size());
  out.weight.assign(vertices, 0);
  out.member_ptr.assign(vertices + 1, 0);
  const auto group = [&](std::int64_t v) {
    return static_cast<std::size_t>(numbering.number[static_cast<std::size_t>(leader[at(v)])]);
  };
  const auto take = [](Index& counter) {
    return std::atomic_ref<Index>(counter).fetch_add(1, std::memory_order_relaxed);
  };
  pool.for_each_range(n, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t v = begin; v < end; ++v) take(out.weight[group(v)]);
  });
  std::partial_sum(out.weight.begin(), out.weight.end(), out.member_ptr.begin() + 1);
  out.members.resize(leader.size());
  std::vector<Index> next(out.member_ptr.begin(), out.member_ptr.end() - 1);
  pool.for_each_range(n, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t v = begin; v < end; ++v) out.members[at(take(next[group(v)]))] = static_cast<Index>(v);
  });
  pool.for_each_range(static_cast<std::int64_t>(vertices), kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k)
      std::sort(out.members.begin() + out.member_ptr[k], out.members.begin() + out.member_ptr[k + 1]);
  });
}

/// Writes the graph whose vertex k has the neighbours list(k, buffer), sorted and unique.
template <class List>
Graph build_graph(Index n, base::ThreadPool& pool, const List& list) {
  Graph g{n, std::vector<Offset>(at(n) + 1, 0), {}};
  pool.for_each_range(n, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    std::vector<Index> buffer;
    for (auto k = at(begin); k < at(end); ++k) {
      buffer.clear();
      list(k, buffer);
      g.ptr[k + 1] = static_cast<Offset>(buffer.size());
    }
  });
  std::partial_sum(g.ptr.begin(), g.ptr.end(), g.ptr.begin());
  g.adj.resize(at(g.ptr.back()));
  pool.for_each_range(n, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    std::vector<Index> buffer;
    for (auto k = at(begin); k < at(end); ++k) {
      buffer.clear();
      list(k, buffer);
      std::copy(buffer.begin(), buffer.end(), g.adj.begin() + g.ptr[k]);
    }
  });
  return g;
}

bool same_closed_neighbourhood(const Graph& g, Index u, Index v) {  // for neighbours u < v
  const auto a = g.neighbours(u), b = g.neighbours(v);
  if (a.size() != b.size()) return false;
  std::size_t i = 0, k = 0;
  for (;;) {
    if (i < a.size() && a[i] == v) ++i;
    if (k < b.size() && b[k] == u) ++k;
    if (i == a.size() || k == b.size()) return i == a.size() && k == b.size();
    if (a[i++] != b[k++]) return false;
  }
}

/// leader[v]: the lowest vertex with the closed neighbourhood of v (they are neighbours of each other, so only
/// neighbours are looked at; hashes first, as in Ashcraft 1995).
std::vector<Index> find_leaders(const Graph& g, base::ThreadPool& pool) {
  const auto n = at(g.n);
  std::vector<std::uint64_t> hash(n);
  pool.for_each_range(g.n, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t v = begin; v < end; ++v) {
      std::uint64_t sum = hash_of(static_cast<Index>(v));
      for (const Index u : g.neighbours(static_cast<Index>(v))) sum += hash_of(u);
      hash[at(v)] = sum;
    }
  });
  std::vector<Index> leader(n);
  pool.for_each_range(g.n, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    for (Index v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v) {
      Index found = v;
      for (const Index u : g.neighbours(v)) {
        if (u > v) break;
        if (hash[at(u)] != hash[at(v)]) continue;
        if (!same_closed_neighbourhood(g, u, v)) continue;
        found = u;
        break;
      }
      leader[at(v)] = found;
    }
  });
  return leader;
}

/// The members of `outer`, whose vertices are groups of vertices of `inner`, replaced by the members of those.
void expand_members(CompressedGraph& outer, const CompressedGraph& inner, base::ThreadPool& pool) {
  const auto vertices = static_cast<std::int64_t>(outer.weight.size());
  const std::vector<Index> groups = std::move(outer.members);
  const std::vector<Index> first = std::move(outer.member_ptr);
  const auto each_group = [&](std::size_t v, const auto& use) {
    for (Index k = first[v]; k < first[v + 1]; ++k) use(static_cast<std::size_t>(groups[at(k)]));
  };
  pool.for_each_range(vertices, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto v = at(begin); v < at(end); ++v) {
      outer.weight[v] = 0;
      each_group(v, [&](std::size_t w) { outer.weight[v] += inner.weight[w]; });
    }
  });
  outer.member_ptr.assign(outer.weight.size() + 1, 0);
  std::partial_sum(outer.weight.begin(), outer.weight.end(), outer.member_ptr.begin() + 1);
  outer.members.resize(inner.members.size());
  pool.for_each_range(vertices, kCompressRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto v = at(begin); v < at(end); ++v) {
      auto to = outer.members.begin() + outer.member_ptr[v];
      each_group(v, [&](std::size_t w) {
        to = std::copy_n(inner.members.begin() + inner.member_ptr[w], inner.weight[w], to);
      });
    }
  });
}

CompressedGraph merge_twins(const Graph& g, base::ThreadPool& pool) {
  const std::vector<Index> leader = find_leaders(g, pool);
  const Numbering numbering = number_leaders(leader, pool);
  CompressedGraph out;
  // A neighbour of v stands for its group only if it leads it; the leader of every neighbour is a neighbour too.
  out.graph = build_graph(static_cast<Index>(numbering.leaders.size()), pool, [&](std::size_t k, auto& buffer) {
    for (const Index u : g.neighbours(numbering.leaders[k]))
      if (numbering.number[at(u)] >= 0) buffer.push_back(numbering.number[at(u)]);
  });
  list_members(leader, numbering, pool, out);
  return out;
}

bool has_pairs(std::span<const Index> pair) {
  for (std::size_t v = 0; v < pair.size(); ++v)
    if (pair[v] != static_cast<Index>(v)) return true;
  return false;
}

CompressedGraph singletons(const Graph& g) {
  CompressedGraph out{g, std::vector<Index>(at(g.n), 1), std::vector<Index>(at(g.n) + 1), std::vector<Index>(at(g.n))};
  std::iota(out.member_ptr.begin(), out.member_ptr.end(), 0);
  std::iota(out.members.begin(), out.members.end(), 0);
  return out;
}

}  // namespace

CompressedGraph compress_pairs(const Graph& graph, std::span<const Index> pair, base::ThreadPool& pool) {
  if (!has_pairs(pair)) return singletons(graph);
  std::vector<Index> leader(pair.size());
  for (std::size_t v = 0; v < pair.size(); ++v) leader[v] = std::min(static_cast<Index>(v), pair[v]);
  const Numbering numbering = number_leaders(leader, pool);
  CompressedGraph out;
  list_members(leader, numbering, pool, out);
  out.graph = build_graph(static_cast<Index>(numbering.leaders.size()), pool, [&](std::size_t k, auto& buffer) {
    const auto append = [&](Index v) {
      for (const Index u : graph.neighbours(v)) {
        const Index w = numbering.number[static_cast<std::size_t>(leader[at(u)])];
        if (w != static_cast<Index>(k)) buffer.push_back(w);
      }
    };
    const Index v = numbering.leaders[k];
    append(v);
    if (pair[at(v)] != v) append(pair[at(v)]);
    if (!std::is_sorted(buffer.begin(), buffer.end())) std::sort(buffer.begin(), buffer.end());
    buffer.erase(std::unique(buffer.begin(), buffer.end()), buffer.end());
  });
  return out;
}

CompressedGraph compress(const Graph& graph, std::span<const Index> pair, base::ThreadPool& pool) {
  if (!has_pairs(pair)) return merge_twins(graph, pool);
  const CompressedGraph paired = compress_pairs(graph, pair, pool);
  CompressedGraph out = merge_twins(paired.graph, pool);
  expand_members(out, paired, pool);
  return out;
}

}  // namespace espalier::analysis
