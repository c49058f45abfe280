#include "analysis/ordering/bisection.hpp"

#include <algorithm>
#include <cstdlib>

#include "analysis/ordering/gain_heap.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

// Hill climbing ends after so many moves without gain; 50 and 100 cost a third more time and gained nothing.
constexpr std::size_t kPatience = 25;

class CutRefiner {
 public:
  CutRefiner(const PartGraph& g, Offset most_side, Bisection& b)
      : g_(g),
        most_side_(most_side),
        b_(b),
        queue_{GainHeap(at(g.n())), GainHeap(at(g.n()))},
        gain_(at(g.n()), 0),
        degree_(at(g.n()), 0),
        moved_(at(g.n()), 0) {
    compute_gains();
  }
  bool pass();

 private:
  void compute_gains();
  [[nodiscard]] int choose() const;
  void flip(Index v, bool queued);

  const PartGraph& g_;
  const Offset most_side_;
  Bisection& b_;
  GainHeap queue_[2];          // boundary vertices of side 0, 1 that have not moved yet
  std::vector<Index> gain_;    // by how much the cut falls when the vertex changes sides
  std::vector<Index> degree_;  // weight of all edges of the vertex
  std::vector<char> moved_;
  std::vector<Index> moves_;
};

void CutRefiner::compute_gains() {
  for (Index v = 0; v < g_.n(); ++v)
    for (Offset e = g_.ptr[at(v)]; e < g_.ptr[at(v) + 1]; ++e) {
      degree_[at(v)] += g_.edge[at(e)];
      gain_[at(v)] += b_.side[at(g_.adj[at(e)])] != b_.side[at(v)] ? g_.edge[at(e)] : -g_.edge[at(e)];
    }
}

/// The side that gives a vertex away: the one above the limit, else the one with the better gain.
int CutRefiner::choose() const {
  for (int s = 0; s < 2; ++s)
    if (b_.weight[at(s)] > most_side_) return queue_[s].empty() ? -1 : s;
  bool possible[2];
  for (int s = 0; s < 2; ++s)
    possible[s] = !queue_[s].empty() && b_.weight[at(1 - s)] + g_.weight[at(queue_[s].top())] <= most_side_;
  if (!possible[0] && !possible[1]) return -1;
  if (possible[0] != possible[1]) return possible[0] ? 0 : 1;
  if (queue_[0].top_gain() != queue_[1].top_gain()) return queue_[0].top_gain() > queue_[1].top_gain() ? 0 : 1;
  return b_.weight[0] >= b_.weight[1] ? 0 : 1;
}

void CutRefiner::flip(Index v, bool queued) {
  const std::size_t from = at(b_.side[at(v)]);
  b_.weight[from] -= g_.weight[at(v)];
  b_.weight[1 - from] += g_.weight[at(v)];
  b_.side[at(v)] = static_cast<char>(1 - from);
  b_.cut -= gain_[at(v)];
  gain_[at(v)] = -gain_[at(v)];
  for (Offset e = g_.ptr[at(v)]; e < g_.ptr[at(v) + 1]; ++e) {
    const Index u = g_.adj[at(e)];
    // u's edge to v is now across if u stayed on v's old side.
    const Index change = (at(b_.side[at(u)]) == from ? 2 : -2) * g_.edge[at(e)];
    gain_[at(u)] += change;
    if (!queued || moved_[at(u)] != 0) continue;
    GainHeap& queue = queue_[at(b_.side[at(u)])];
    if (queue.contains(u))
      queue.change(u, change);
    else
      queue.insert(u, gain_[at(u)]);
  }
}

bool CutRefiner::pass() {
  for (Index v = 0; v < g_.n(); ++v)
    if (gain_[at(v)] > -degree_[at(v)]) queue_[at(b_.side[at(v)])].insert(v, gain_[at(v)]);
  const Offset start = b_.cut;
  const auto imbalance = [&] { return std::abs(b_.weight[0] - b_.weight[1]); };
  Offset best = start, best_imbalance = imbalance();
  bool allowed = std::max(b_.weight[0], b_.weight[1]) <= most_side_;
  std::size_t best_moves = 0;
  while (moves_.size() - best_moves < kPatience) {
    const int s = choose();
    if (s < 0) break;
    const Index v = queue_[s].top();
    queue_[s].remove(v);
    moved_[at(v)] = 1;
    moves_.push_back(v);
    flip(v, true);
    const bool now_allowed = std::max(b_.weight[0], b_.weight[1]) <= most_side_;
    if ((now_allowed && !allowed) ||
        (now_allowed == allowed && (b_.cut < best || (b_.cut == best && imbalance() < best_imbalance)))) {
      allowed = now_allowed;
      best = b_.cut;
      best_imbalance = imbalance();
      best_moves = moves_.size();
    }
  }
  queue_[0].clear();
  queue_[1].clear();
  for (const Index v : moves_) moved_[at(v)] = 0;
  const bool better = best_moves > 0;
  for (; moves_.size() > best_moves; moves_.pop_back()) flip(moves_.back(), false);
  moves_.clear();
  return better;
}

}  // namespace

Bisection grow_bisection(const PartGraph& g, Random& random) {
  Bisection b{std::vector<char>(at(g.n()), 1), {0, g.total}, 0};
  GainHeap front(at(g.n()));
  std::vector<Index> gain(at(g.n()), 0);
  Index fresh = random.below(g.n());
  while (2 * b.weight[0] < g.total) {
    Index v = fresh;
    if (!front.empty()) {
      v = front.top();
      front.remove(v);
    } else {  // the first vertex, or a component is used up
      while (b.side[at(v)] == 0) v = (v + 1) % g.n();
      for (Offset e = g.ptr[at(v)]; e < g.ptr[at(v) + 1]; ++e) gain[at(v)] -= g.edge[at(e)];
    }
    b.side[at(v)] = 0;
    b.weight[0] += g.weight[at(v)];
    b.weight[1] -= g.weight[at(v)];
    b.cut -= gain[at(v)];
    for (Offset e = g.ptr[at(v)]; e < g.ptr[at(v) + 1]; ++e) {
      const Index u = g.adj[at(e)];
      if (b.side[at(u)] == 0) continue;
      if (front.contains(u)) {
        gain[at(u)] += 2 * g.edge[at(e)];
        front.change(u, 2 * g.edge[at(e)]);
        continue;
      }
      gain[at(u)] = 2 * g.edge[at(e)];
      for (Offset k = g.ptr[at(u)]; k < g.ptr[at(u) + 1]; ++k) gain[at(u)] -= g.edge[at(k)];
      front.insert(u, gain[at(u)]);
    }
  }
  return b;
}

void refine(const PartGraph& graph, Offset most_side, int passes, Bisection& bisection) {
  CutRefiner refiner(graph, most_side, bisection);
  for (int k = 0; k < passes; ++k)
    if (!refiner.pass()) return;
}

}  // namespace espalier::analysis
