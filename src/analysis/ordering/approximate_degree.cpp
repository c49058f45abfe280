#include "analysis/ordering/approximate_degree.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

// A vertex is a variable until it is eliminated, then the element of its pivot: the clique of what it was joined to.
// The list of a variable names elements, then variables, and never gets longer; those of elements are appended.
class QuotientGraph {
 public:
  QuotientGraph(const PartGraph& g, Index inner)
      : n_(g.n()),
        inner_(inner),
        weight_(g.weight),
        begin_(g.ptr.begin(), g.ptr.end() - 1),
        length_(at(n_)),
        elements_(at(n_), 0),
        degree_(at(n_)),
        bound_(at(n_), 0),
        list_(g.adj.begin(), g.adj.end()),
        next_(at(n_), -1),
        before_(at(n_), -1),
        last_member_(at(n_)),
        next_member_(at(n_), -1),
        dead_(at(n_), 0) {
    left_ = std::accumulate(weight_.begin(), weight_.end(), Index{0});
    head_.assign(at(left_) + 1, -1);
    std::iota(last_member_.begin(), last_member_.end(), 0);
    for (Index v = 0; v < n_; ++v) {
      length_[at(v)] = static_cast<Index>(g.ptr[at(v) + 1] - g.ptr[at(v)]);
      for (Offset k = g.ptr[at(v)]; k < g.ptr[at(v) + 1]; ++k) degree_[at(v)] += weight_[at(g.adj[at(k)])];
    }
    for (Index v = inner_; v-- > 0;) insert(v);
  }

  MinimumDegreeOrder run() {
    MinimumDegreeOrder out;
    out.order.reserve(at(inner_));
    const std::int64_t most = kMostWork * (static_cast<std::int64_t>(list_.size()) + n_);
    while (static_cast<Index>(out.order.size()) < inner_) {
      if (work_ > most) return {};
      const Index pivot = take_least();
      eliminate(pivot);
      const double k = pivot_weight_, d = clique_weight_;
      out.flops += k * k * k / 3 + k * k * d + k * d * d;
      out.largest = std::max(out.largest, pivot_weight_ + clique_weight_);
      for (Index v = pivot; v >= 0; v = next_member_[at(v)]) out.order.push_back(v);
    }
    return out;
  }

 private:
  // Variables of the halo never stand among those by degree.
  void insert(Index v) {
    if (v >= inner_) return;
    Index& first = head_[at(degree_[at(v)])];
    next_[at(v)] = first;
    before_[at(v)] = -1;
    if (first >= 0) before_[at(first)] = v;
    first = v;
    least_ = std::min(least_, degree_[at(v)]);
  }
  void remove(Index v) {
    if (v >= inner_) return;
    const Index next = next_[at(v)], before = before_[at(v)];
    if (next >= 0) before_[at(next)] = before;
    (before >= 0 ? next_[at(before)] : head_[at(degree_[at(v)])]) = next;
  }
  Index take_least() {
    while (head_[at(least_)] < 0) ++least_;
    const Index v = head_[at(least_)];
    remove(v);
    return v;
  }
  // w goes where v goes.
  void join(Index v, Index w) {
    next_member_[at(last_member_[at(v)])] = w;
    last_member_[at(v)] = last_member_[at(w)];
    dead_[at(w)] = 1;
  }

  void eliminate(Index pivot) {
    pivot_weight_ = weight_[at(pivot)];
    left_ -= pivot_weight_;
    gather_clique(pivot);
    measure_elements();
    for (const Index v : clique_) update(pivot, v);
    left_ -= pivot_weight_ - weight_[at(pivot)];  // of what was eliminated with it
    merge_alike();
    finish(pivot);
  }

  // The variables that the pivot is joined to, directly or by an element; these elements are part of the new one.
  void gather_clique(Index pivot) {
    clique_.clear();
    clique_weight_ = 0;
    dead_[at(pivot)] = 1;
    const auto add = [&](Index v) {
      if (dead_[at(v)] != 0) return;
      dead_[at(v)] = kInClique;
      clique_.push_back(v);
      clique_weight_ += weight_[at(v)];
      remove(v);
    };
    const Index* const mine = list_.data() + begin_[at(pivot)];
    for (Index k = 0; k < elements_[at(pivot)]; ++k) {
      const Index e = mine[k];
      if (dead_[at(e)] == kAbsorbed) continue;
      work_ += length_[at(e)];
      for (Index q = 0; q < length_[at(e)]; ++q) add(list_[at(begin_[at(e)] + q)]);
      dead_[at(e)] = kAbsorbed;
    }
    for (Index k = elements_[at(pivot)]; k < length_[at(pivot)]; ++k) add(mine[k]);
  }

  // bound_[e] - mark_: the weight of element e outside the clique.
  void measure_elements() {
    mark_ += most_ + 1;
    most_ = 0;
    for (const Index v : clique_)
      for (Index k = 0; k < elements_[at(v)]; ++k) {
        const Index e = list_[at(begin_[at(v)] + k)];
        if (dead_[at(e)] == kAbsorbed) continue;
        std::int64_t& b = bound_[at(e)];
        if (b < mark_) b = mark_ + degree_[at(e)];
        most_ = std::max<std::int64_t>(most_, degree_[at(e)]);
        b -= weight_[at(v)];
      }
  }

  // What is left of the lists of v, behind the new element; the bound of its degree outside the clique.
  void update(Index pivot, Index v) {
    const std::size_t begin = at(begin_[at(v)]);
    Index kept = 0, outside = 0;
    std::uint64_t hash = 0;
    const Index elements = elements_[at(v)], all = length_[at(v)];
    work_ += all;
    scratch_.clear();
    for (Index k = 0; k < all; ++k) {
      const Index u = list_[begin + at(k)];
      if (k < elements) {
        if (dead_[at(u)] == kAbsorbed) continue;
        const auto rest = static_cast<Index>(bound_[at(u)] - mark_);
        if (rest == 0) {
          dead_[at(u)] = kAbsorbed;
          continue;
        }
        outside += rest;
        ++kept;
      } else {
        if (dead_[at(u)] != 0) continue;  // gone, or in the clique
        outside += weight_[at(u)];
      }
      hash += static_cast<std::uint64_t>(u);
      scratch_.push_back(u);
    }
    if (scratch_.empty() && v < inner_) {  // nothing outside the clique: it can follow at once without more fill
      pivot_weight_ += weight_[at(v)];
      clique_weight_ -= weight_[at(v)];
      join(pivot, v);
      return;
    }
    list_[begin] = pivot;  // a place is free: that of the pivot, or of an element that the new one has taken in
    std::copy(scratch_.begin(), scratch_.end(), list_.begin() + static_cast<std::ptrdiff_t>(begin) + 1);
    elements_[at(v)] = kept + 1;
    length_[at(v)] = static_cast<Index>(scratch_.size()) + 1;
    degree_[at(v)] = std::min(degree_[at(v)], outside);
    alike_.push_back({hash, v});
  }

  [[nodiscard]] bool same_lists(Index v, Index w) {
    if (length_[at(v)] != length_[at(w)] || elements_[at(v)] != elements_[at(w)]) return false;
    if ((v < inner_) != (w < inner_)) return false;
    const auto sorted = [&](Index x, std::vector<Index>& to) {
      const auto from = list_.begin() + begin_[at(x)];
      to.assign(from, from + length_[at(x)]);
      std::sort(to.begin(), to.end());
    };
    sorted(v, scratch_);
    sorted(w, other_);
    return scratch_ == other_;
  }

  // Variables of the clique with the same lists are one from now on.
  void merge_alike() {
    std::sort(alike_.begin(), alike_.end());
    for (std::size_t a = 0; a < alike_.size(); ++a) {
      const Index v = alike_[a].second;
      if (dead_[at(v)] != kInClique) continue;
      for (std::size_t b = a + 1; b < alike_.size() && alike_[b].first == alike_[a].first; ++b) {
        const Index w = alike_[b].second;
        if (dead_[at(w)] != kInClique || !same_lists(v, w)) continue;
        weight_[at(v)] += weight_[at(w)];
        join(v, w);
      }
    }
    alike_.clear();
  }

  void finish(Index pivot) {
    begin_[at(pivot)] = static_cast<Offset>(list_.size());
    for (const Index v : clique_) {
      if (dead_[at(v)] != kInClique) continue;
      dead_[at(v)] = 0;
      list_.push_back(v);
      degree_[at(v)] = std::min(degree_[at(v)] + clique_weight_, left_) - weight_[at(v)];
      insert(v);
    }
    length_[at(pivot)] = static_cast<Index>(static_cast<Offset>(list_.size()) - begin_[at(pivot)]);
    degree_[at(pivot)] = clique_weight_;
    if (length_[at(pivot)] == 0) dead_[at(pivot)] = kAbsorbed;
  }

  // Values of dead_: 0 a variable, 1 gone into another or eliminated (then an element).
  static constexpr char kInClique = 2, kAbsorbed = 3;

  // Steps through lists, for each edge and vertex. Grids take 5 to 20, systems that end as one dense front 100.
  static constexpr std::int64_t kMostWork = 300;

  Index n_, inner_;
  std::int64_t work_ = 0;
  Index left_ = 0;               // weight not eliminated
  std::vector<Index> weight_;    // of variables, with those that are one with them
  std::vector<Offset> begin_;    // of the list of each vertex in list_
  std::vector<Index> length_;    // of it
  std::vector<Index> elements_;  // how many elements begin it
  std::vector<Index> degree_;    // of a variable: bound of the weight around it; of an element: its weight
  std::vector<std::int64_t> bound_;
  std::vector<Index> list_;
  std::vector<Index> head_, next_, before_;  // variables by degree
  Index least_ = 0;
  std::vector<Index> last_member_, next_member_;  // what is eliminated with a variable
  std::vector<char> dead_;
  std::int64_t mark_ = 1, most_ = 0;
  std::vector<Index> clique_, scratch_, other_;
  std::vector<std::pair<std::uint64_t, Index>> alike_;
  Index pivot_weight_ = 0, clique_weight_ = 0;
};

}  // namespace

MinimumDegreeOrder approximate_minimum_degree(const PartGraph& graph) { return QuotientGraph(graph, graph.n()).run(); }

MinimumDegreeOrder approximate_minimum_degree(const PartGraph& graph, Index inner) {
  return QuotientGraph(graph, inner).run();
}

}  // namespace espalier::analysis
