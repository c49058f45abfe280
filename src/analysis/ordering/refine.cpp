#include "analysis/ordering/refine.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "analysis/ordering/gain_heap.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

// Hill climbing ends after so many moves without gain (METIS: 300 or 500), or, as long as the separator is hardly
// heavier than the best one, after kLongPatience times as many: in grids of points long steps lead there.
constexpr std::size_t kMovesWithoutGain = 300;
constexpr std::size_t kLongPatience = 3;
constexpr double kHardlyHeavier = 1.1;
constexpr double kImbalance = 0.1;  // see score()

double score_of(const std::array<Offset, 3>& weight) {
  const double sides = static_cast<double>(weight[0] + weight[1]);
  if (sides == 0) return std::numeric_limits<double>::infinity();
  const double imbalance = static_cast<double>(weight[0] - weight[1]) / sides;
  // An empty separator is the best one, but an even one of two empty ones is better.
  return (static_cast<double>(weight[2]) + 1e-3) * (1 + kImbalance * imbalance * imbalance);
}

class Refiner {
 public:
  Refiner(const PartGraph& g, Offset most_side, Separation& s)
      : g_(g), most_side_(most_side), s_(s), queue_(at(g.n())) {
    for (Index v = 0; v < g.n(); ++v)
      if (s.side[at(v)] == 2) separator_.push_back(v);
  }
  bool pass(int to);

 private:
  struct Move {
    Index vertex;
    std::size_t pulled;  // first of the vertices that it pulled into the separator, in pulled_
  };

  void enqueue(Index v);
  void move(Index v);
  void pull(Index u);
  void undo_to(std::size_t moves);

  const PartGraph& g_;
  const Offset most_side_;
  Separation& s_;
  std::size_t to_ = 0, from_ = 1;  // the side that vertices of the separator join, and the side that loses
  GainHeap queue_;                 // separator vertices by the gain of moving them
  std::vector<Index> separator_;
  std::vector<Move> moves_;
  std::vector<Index> pulled_;
};

/// Gain of moving v: its own weight leaves the separator, its neighbours on the losing side enter.
void Refiner::enqueue(Index v) {
  Index gain = g_.weight[at(v)];
  for (Offset k = g_.ptr[at(v)]; k < g_.ptr[at(v) + 1]; ++k) {
    const Index u = g_.adj[at(k)];
    if (at(s_.side[at(u)]) == from_) gain -= g_.weight[at(u)];
  }
  queue_.insert(v, gain);
}

/// u leaves the losing side for the separator.
void Refiner::pull(Index u) {
  s_.side[at(u)] = 2;
  s_.weight[from_] -= g_.weight[at(u)];
  s_.weight[2] += g_.weight[at(u)];
  pulled_.push_back(u);
  Index gain = g_.weight[at(u)];  // as in enqueue()
  for (Offset k = g_.ptr[at(u)]; k < g_.ptr[at(u) + 1]; ++k) {
    const Index w = g_.adj[at(k)];
    const auto side = at(s_.side[at(w)]);
    if (side == from_)
      gain -= g_.weight[at(w)];
    else if (side == 2 && queue_.contains(w))
      queue_.change(w, g_.weight[at(u)]);
  }
  queue_.insert(u, gain);
}

void Refiner::move(Index v) {
  queue_.remove(v);
  moves_.push_back({v, pulled_.size()});
  s_.side[at(v)] = static_cast<char>(to_);
  s_.weight[to_] += g_.weight[at(v)];
  s_.weight[2] -= g_.weight[at(v)];
  for (Offset k = g_.ptr[at(v)]; k < g_.ptr[at(v) + 1]; ++k)
    if (at(s_.side[at(g_.adj[at(k)])]) == from_) pull(g_.adj[at(k)]);
}

void Refiner::undo_to(std::size_t moves) {
  for (; moves_.size() > moves; moves_.pop_back()) {
    const Move& m = moves_.back();
    s_.side[at(m.vertex)] = 2;
    s_.weight[to_] -= g_.weight[at(m.vertex)];
    s_.weight[2] += g_.weight[at(m.vertex)];
    separator_.push_back(m.vertex);
    for (; pulled_.size() > m.pulled; pulled_.pop_back()) {
      const Index u = pulled_.back();
      s_.side[at(u)] = static_cast<char>(from_);
      s_.weight[from_] += g_.weight[at(u)];
      s_.weight[2] -= g_.weight[at(u)];
    }
  }
}

/// @return true when the score fell
bool Refiner::pass(int to) {
  to_ = at(to);
  from_ = 1 - to_;
  for (const Index v : separator_) enqueue(v);
  const double start = score_of(s_.weight);
  double best = start;
  std::size_t best_moves = 0;
  const std::size_t patience = std::min<std::size_t>(kMovesWithoutGain, 3 * separator_.size());
  Offset least =
      s_.weight[2];  // lightest separator so far; to meet it again is progress: a step in a plane runs to the rim
  std::size_t progress = 0;
  const auto hopeful = [&] {
    const std::size_t since = moves_.size() - progress;
    return since < patience || (since < kLongPatience * patience &&
                                static_cast<double>(s_.weight[2]) < kHardlyHeavier * static_cast<double>(least));
  };
  while (!queue_.empty() && hopeful()) {
    const Index v = queue_.top();
    if (s_.weight[to_] + g_.weight[at(v)] > most_side_) {  // would tip the balance: others may still fit
      queue_.remove(v);
      continue;
    }
    move(v);
    if (s_.weight[2] <= least) {
      least = s_.weight[2];
      progress = moves_.size();
    }
    const double now = score_of(s_.weight);
    if (now < best) {
      best = now;
      best_moves = moves_.size();
    }
  }
  queue_.clear();
  separator_.insert(separator_.end(), pulled_.begin(), pulled_.end());
  undo_to(best_moves);
  std::sort(separator_.begin(), separator_.end());
  separator_.erase(std::unique(separator_.begin(), separator_.end()), separator_.end());
  std::erase_if(separator_, [&](Index v) { return s_.side[at(v)] != 2; });
  moves_.clear();
  pulled_.clear();
  return best < start;
}

}  // namespace

double score(const Separation& s) { return score_of(s.weight); }

void refine(const PartGraph& graph, Offset most_side, int passes, Separation& separation) {
  Refiner refiner(graph, most_side, separation);
  int to = separation.weight[0] < separation.weight[1] ? 0 : 1;
  int failed = 0;  // in a row; both directions must fail
  for (int k = 0; k < passes && failed < 2; ++k, to = 1 - to) failed = refiner.pass(to) ? 0 : failed + 1;
}

}  // namespace espalier::analysis
