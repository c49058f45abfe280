#include "analysis/ordering/coarsen.hpp"

#include <algorithm>
#include <bit>
#include <memory>
#include <numeric>
#include <span>
#include <utility>

#include "analysis/ordering/pair_matching.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

/// Vertices per range: small graphs are one range, large ones some dozen.
Index grain_of(Index n) { return std::max<Index>(4096, (n + 63) / 64); }

/// Numbers the pairs by their lower vertices. @return the lower vertices
std::vector<Index> number_pairs(std::span<const Index> mate, std::vector<Index>& map, base::Recursion& workers) {
  const auto n = static_cast<Index>(mate.size());
  const Index grain = grain_of(n);
  map.resize(mate.size());
  std::vector<Index> first(at((n + grain - 1) / grain) + 1, 0);  // pairs before each range
  workers.for_each_range(n, grain, [&](std::int64_t begin, std::int64_t end) {
    Index count = 0;
    for (auto v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v) count += v <= mate[at(v)] ? 1 : 0;
    first[at(begin / grain) + 1] = count;
  });
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<Index> lower(at(first.back()));
  workers.for_each_range(n, grain, [&](std::int64_t begin, std::int64_t end) {
    Index k = first[at(begin / grain)];
    for (auto v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v) {
      if (v > mate[at(v)]) continue;
      lower[at(k)] = v;
      map[at(v)] = map[at(mate[at(v)])] = k++;  // nobody else writes to the mate
    }
  });
  return lower;
}

/// The rows of a range of coarse vertices, one after the other. Where the edges of the row being made stand is noted by
/// vertex in a small graph, in a hash table in a large one: that stays in the fastest cache.
class RowSums {
 public:
  RowSums(Offset most, Index vertices)
      : adj_(at(most)), edge_(at(most)), by_vertex_(vertices <= kSmall), places_(by_vertex_ ? at(vertices) : 0, -1) {}

  void begin_row(Offset most) {
    begin_ = size_;
    if (by_vertex_ || 2 * at(most) <= places_.size()) return;
    places_.assign(std::bit_ceil(2 * at(most)), -1);
    shift_ = 64 - std::countr_zero(places_.size());
  }
  void add(Index to, Index weight) {
    Offset& place = places_[by_vertex_ ? at(to) : find(to)];
    if (place >= begin_) {
      edge_[at(place)] += weight;
      return;
    }
    place = size_;
    adj_[at(size_)] = to;
    edge_[at(size_++)] = weight;
  }
  [[nodiscard]] Offset size() const { return size_; }
  void copy_to(Index* adj, Index* edge) const {
    std::copy_n(adj_.begin(), size_, adj);
    std::copy_n(edge_.begin(), size_, edge);
  }

 private:
  static constexpr Index kSmall = 4096;

  /// The slot of `to`, or the one that it may have: empty, or left by a row before this one.
  [[nodiscard]] std::size_t find(Index to) const {
    std::size_t h = at(to) * 0x9e3779b97f4a7c15ULL >> shift_;
    while (places_[h] >= begin_ && adj_[at(places_[h])] != to) h = (h + 1) & (places_.size() - 1);
    return h;
  }

  base::LazyVector<Index> adj_, edge_;
  bool by_vertex_;
  std::vector<Offset> places_;
  int shift_ = 63;
  Offset begin_ = 0, size_ = 0;
};

}  // namespace

Coarser coarsen(const PartGraph& g, Offset most_weight, Random& random, base::Recursion& workers) {
  const std::vector<Index> mate = match_pairs(g, most_weight, random, workers);
  Coarser out;
  const std::vector<Index> lower = number_pairs(mate, out.map, workers);
  const auto coarse = static_cast<Index>(lower.size());
  const Index grain = grain_of(coarse);
  const auto degree = [&](Index v) { return g.ptr[at(v) + 1] - g.ptr[at(v)]; };
  PartGraph& c = out.graph;
  c.total = g.total;
  c.weight.resize(lower.size());
  c.ptr.resize(lower.size() + 1);
  c.ptr[0] = 0;
  std::vector<std::unique_ptr<RowSums>> ranges(at((coarse + grain - 1) / grain));
  workers.for_each_range(coarse, grain, [&](std::int64_t begin, std::int64_t end) {
    const auto most = [&](Index v) { return degree(v) + (mate[at(v)] == v ? 0 : degree(mate[at(v)])); };
    Offset all = 0;
    for (std::int64_t k = begin; k < end; ++k) all += most(lower[at(k)]);
    auto sums = std::make_unique<RowSums>(all, coarse);
    for (auto k = static_cast<Index>(begin); k < static_cast<Index>(end); ++k) {
      const Index v = lower[at(k)], u = mate[at(v)];
      sums->begin_row(most(v));
      const auto append = [&](Index part) {
        for (Offset e = g.ptr[at(part)]; e < g.ptr[at(part) + 1]; ++e)
          if (const Index to = out.map[at(g.adj[at(e)])]; to != k) sums->add(to, g.edge[at(e)]);
      };
      append(v);
      if (u != v) append(u);
      c.weight[at(k)] = g.weight[at(v)] + (u == v ? 0 : g.weight[at(u)]);
      c.ptr[at(k) + 1] = sums->size();
    }
    ranges[at(begin / grain)] = std::move(sums);
  });
  Offset size = 0;
  std::vector<Offset> first(ranges.size());
  for (std::size_t p = 0; p < ranges.size(); ++p) {
    first[p] = size;
    size += ranges[p]->size();
  }
  c.adj.resize(at(size));
  c.edge.resize(at(size));
  workers.for_each_range(coarse, grain, [&](std::int64_t begin, std::int64_t end) {
    const std::size_t p = at(begin / grain);
    ranges[p]->copy_to(c.adj.data() + first[p], c.edge.data() + first[p]);
    ranges[p].reset();
    for (std::int64_t k = begin; k < end; ++k) c.ptr[at(k) + 1] += first[p];
  });
  return out;
}

}  // namespace espalier::analysis
