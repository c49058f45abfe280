#include "analysis/ordering/pair_matching.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <numeric>
#include <utility>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

constexpr Index kTogether = 1 << 14;       // graphs from this size on are matched in rounds
constexpr std::int64_t kPairRange = 1024;  // per range of a loop over the vertices that choose
constexpr Index kRounds = 12;  // parts into which the vertices are cut: fewer clash more, more wait more often

/// Degrees above the average count as equal.
class DegreeClasses {
 public:
  explicit DegreeClasses(const PartGraph& g) : g_(g), average_(g.ptr.back() / std::max<Index>(1, g.n()) + 1) {}
  [[nodiscard]] std::size_t count() const { return at(average_) + 1; }
  [[nodiscard]] std::size_t of(Index v) const { return at(std::min(average_, g_.ptr[at(v) + 1] - g_.ptr[at(v)])); }

 private:
  const PartGraph& g_;
  Offset average_;
};

/// The vertices in random order, then stably by degree.
std::vector<Index> visiting_order(const PartGraph& g, Random& random) {
  const Index n = g.n();
  std::vector<Index> shuffled(at(n));
  std::iota(shuffled.begin(), shuffled.end(), 0);
  for (Index k = n - 1; k > 0; --k) std::swap(shuffled[at(k)], shuffled[at(random.below(k + 1))]);
  const DegreeClasses classes(g);
  std::vector<Index> count(classes.count() + 1, 0);
  for (Index v = 0; v < n; ++v) ++count[classes.of(v) + 1];
  std::partial_sum(count.begin(), count.end(), count.begin());
  std::vector<Index> order(at(n));
  for (const Index v : shuffled) order[at(count[classes.of(v)]++)] = v;
  return order;
}

std::vector<Index> match_in_turn(const PartGraph& g, Offset most_weight, Random& random) {
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

class RoundMatcher {
 public:
  RoundMatcher(const PartGraph& g, Offset most_weight, std::uint64_t seed, base::Recursion& workers)
      : g_(g), most_weight_(most_weight), seed_(seed), workers_(workers), mate_(at(g.n()), -1), first_(at(g.n())) {}

  std::vector<Index> run();

 private:
  struct Chooser {
    Index vertex;
    Index choice;        // the vertex itself: nobody is left
    std::uint64_t rank;  // round and place in the order: lower ones of the same round go first, later rounds first
  };

  [[nodiscard]] std::vector<Index> scattered_order() const;
  [[nodiscard]] std::uint64_t hash(Index v) const { return Random(seed_ + at(v) * 0x9e3779b97f4a7c15ULL).next(); }
  [[nodiscard]] Index choose(Index v) const;
  void reserve(Index v, std::uint64_t rank);
  void play(std::vector<Chooser>& active);

  const PartGraph& g_;
  const Offset most_weight_;
  const std::uint64_t seed_;
  base::Recursion& workers_;
  std::vector<Index> mate_;
  base::LazyVector<std::uint64_t> first_;  // the lowest rank that wants the vertex
};

/// The vertices by degree, then by a few bits of their hash: neighbours stand apart, which is all that matters here.
std::vector<Index> RoundMatcher::scattered_order() const {
  constexpr std::size_t kBuckets = 64;  // per class of degrees
  const Index n = g_.n();
  const DegreeClasses classes(g_);
  const Index grain = std::max<Index>(1 << 13, (n + 31) / 32);
  const std::size_t ranges = at((n + grain - 1) / grain), buckets = classes.count() * kBuckets;
  const auto bucket = [&](Index v) { return classes.of(v) * kBuckets + (hash(v) >> 58); };
  std::vector<Index> next(ranges * buckets, 0);  // by range, then bucket: how many, then where the next one goes
  const auto each = [&](const auto& use) {
    workers_.for_each_range(n, grain, [&](std::int64_t begin, std::int64_t end) {
      Index* const mine = next.data() + at(begin / grain) * buckets;
      for (auto v = static_cast<Index>(begin); v < static_cast<Index>(end); ++v) use(v, mine[bucket(v)]);
    });
  };
  each([](Index, Index& count) { ++count; });
  Index sum = 0;
  for (std::size_t b = 0; b < buckets; ++b)
    for (std::size_t p = 0; p < ranges; ++p) sum += std::exchange(next[p * buckets + b], sum);
  std::vector<Index> order(at(n));
  each([&](Index v, Index& place) { order[at(place++)] = v; });
  return order;
}

/// The heaviest edge to a vertex that is left; among equals the first behind a place of v's own, so that neighbours
/// with the same neighbours want different ones.
Index RoundMatcher::choose(Index v) const {
  const Offset begin = g_.ptr[at(v)], end = g_.ptr[at(v) + 1];
  Index best = v, heaviest = 0;
  const auto scan = [&](Offset from, Offset to) {
    for (Offset k = from; k < to; ++k) {
      const Index u = g_.adj[at(k)];
      if (g_.edge[at(k)] <= heaviest || mate_[at(u)] >= 0) continue;
      if (Offset{g_.weight[at(u)]} + g_.weight[at(v)] > most_weight_) continue;
      heaviest = g_.edge[at(k)];
      best = u;
    }
  };
  if (begin == end) return v;
  const Offset middle =
      begin + static_cast<Offset>((hash(v) & 0xffffffffU) * static_cast<std::uint64_t>(end - begin) >> 32);
  scan(middle, end);
  scan(begin, middle);
  return best;
}

void RoundMatcher::reserve(Index v, std::uint64_t rank) {
  const std::atomic_ref<std::uint64_t> first(first_[at(v)]);
  std::uint64_t known = first.load(std::memory_order_relaxed);
  while (rank < known && !first.compare_exchange_weak(known, rank, std::memory_order_relaxed)) {
  }
}

/// One round: all of `active` choose; those stay in it that did not get what they wanted.
void RoundMatcher::play(std::vector<Chooser>& active) {
  const auto size = static_cast<std::int64_t>(active.size());
  workers_.for_each_range(size, kPairRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k) {
      Chooser& c = active[k];
      if (mate_[at(c.vertex)] >= 0) {
        c.choice = -1;
        continue;
      }
      c.choice = choose(c.vertex);
      if (c.choice == c.vertex) continue;
      reserve(c.vertex, c.rank);
      reserve(c.choice, c.rank);
    }
  });
  workers_.for_each_range(size, kPairRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = at(begin); k < at(end); ++k) {
      Chooser& c = active[k];
      if (c.choice < 0) continue;
      const bool alone = c.choice == c.vertex;
      if (!alone && (first_[at(c.vertex)] != c.rank || first_[at(c.choice)] != c.rank)) continue;
      mate_[at(c.vertex)] = c.choice;
      mate_[at(c.choice)] = c.vertex;
      c.choice = -1;
    }
  });
  std::erase_if(active, [](const Chooser& c) { return c.choice < 0; });
}

std::vector<Index> RoundMatcher::run() {
  const std::vector<Index> order = scattered_order();
  workers_.for_each_range(g_.n(), 1 << 15, [&](std::int64_t begin, std::int64_t end) {
    std::fill(first_.begin() + begin, first_.begin() + end, ~std::uint64_t{0});
  });
  const Index part = (g_.n() + kRounds - 1) / kRounds;
  std::vector<Chooser> active;
  Index taken = 0;
  for (std::uint64_t round = 1; taken < g_.n() || !active.empty(); ++round) {
    const std::uint64_t base = (0xffffffffU - round) << 32;
    for (Chooser& c : active) c.rank = base | (c.rank & 0xffffffffU);
    for (const Index end = std::min(g_.n(), taken + part); taken < end; ++taken)
      active.push_back({order[at(taken)], -1, base | static_cast<std::uint64_t>(taken)});
    play(active);
  }
  return std::move(mate_);
}

}  // namespace

std::vector<Index> match_pairs(const PartGraph& g, Offset most_weight, Random& random, base::Recursion& workers) {
  if (g.n() < kTogether) return match_in_turn(g, most_weight, random);
  return RoundMatcher(g, most_weight, random.next(), workers).run();
}

}  // namespace espalier::analysis
