#include "analysis/tree_change.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "analysis/changed_rows.hpp"
#include "base/at.hpp"

namespace espalier::analysis {

namespace {

class TreeChange {
  using Edge = PatternChange::Edge;
  static constexpr std::int64_t kFronts = 256;  // per range of a loop
  static constexpr std::int64_t kColumns = 4096;

 public:
  TreeChange(const AssemblyTree& before, const PatternChange& change, base::ThreadPool& pool)
      : old_(before),
        change_(change),
        pool_(pool),
        parent_(before.parent),
        front_(at(before.n)),
        pivots_(at(before.fronts())),
        touched_(at(before.fronts()), 0),
        was_(at(before.fronts())) {
    std::iota(was_.begin(), was_.end(), 0);
    each_front(old_.fronts(), [&](Index f) {
      pivots_[at(f)] = old_.pivots(f);
      for (Index k = old_.first[at(f)]; k < old_.first[at(f) + 1]; ++k) front_[at(old_.order[at(k)])] = f;
    });
    column_of_row_.resize(change.row_of_col.size());
    each_column([&](std::size_t c) {
      if (!column_of_row_.empty()) column_of_row_[at(change.row_of_col[c])] = static_cast<Index>(c);
    });
  }

  ChangedTree run() {
    join_trees();
    if (joined_) drop_and_sort(true);  // ways to the root are followed by rising numbers
    touch_ends(change_.removed);       // an entry that is gone stood in the lower front of before
    lift_unknowns();
    lower_unknowns();
    rows_to_add_.insert(rows_to_add_.end(), change_.added.begin(), change_.added.end());
    touch_ends(change_.added);
    for (const Index v : change_.diagonal) touched_[at(front_[at(v)])] |= kEntries;
    drop_and_sort(false);
    take_pivots();
    make_rows({old_, change_, was_, front_, position_, column_of_row_, touched_, rows_to_add_}, out_, pool_);
    return std::move(out_);
  }

 private:
  template <class Use>
  void each_front(Index fronts, Use&& use) {
    pool_.for_each_range(fronts, kFronts, [&](std::int64_t b, std::int64_t e) {
      for (auto f = static_cast<Index>(b); f < e; ++f) use(f);
    });
  }
  template <class Use>
  void each_column(Use&& use) {
    pool_.for_each_range(old_.n, kColumns, [&](std::int64_t b, std::int64_t e) {
      for (auto c = at(b); c < at(e); ++c) use(c);
    });
  }

  [[nodiscard]] Index root_of(Index f) const {
    while (parent_[at(f)] >= 0) f = parent_[at(f)];
    return f;
  }

  // The root with the lower number becomes a child of the other one.
  void join_trees() {
    for (const auto& [u, v] : change_.added) {
      const Index a = root_of(front_[at(u)]), b = root_of(front_[at(v)]);
      if (a == b) continue;
      parent_[at(std::min(a, b))] = std::max(a, b);
      touched_[at(std::min(a, b))] |= kRows;
      touched_[at(std::max(a, b))] |= kRows;
      joined_ = true;
    }
  }

  // The front in which the ways of both to the root meet.
  [[nodiscard]] Index meeting(Index f, Index g) const {
    while (f != g) {
      Index& lower = f < g ? f : g;
      lower = parent_[at(lower)];
    }
    return f;
  }

  // Work that one more row means on the way from each front to the root.
  [[nodiscard]] std::vector<double> costs_to_root() const {
    std::vector<double> cost(parent_.size(), 0);
    for (auto f = static_cast<Index>(parent_.size()); f-- > 0;) {
      const double pivots = old_.pivots(was_[at(f)]), rows = pivots + old_.rows_below(was_[at(f)]);
      cost[at(f)] = pivots * rows + (parent_[at(f)] >= 0 ? cost[at(parent_[at(f)])] : 0);
    }
    return cost;
  }

  struct Crossing {
    Index u, v, meeting;
  };

  // Edges that meet higher up come first: who goes there has settled his lower ones, too.
  [[nodiscard]] std::vector<Crossing> crossings() const {
    std::vector<Crossing> list;
    for (const auto& [u, v] : change_.added) {
      const Index f = front_[at(u)], g = front_[at(v)], m = meeting(f, g);
      if (m != f && m != g) list.push_back({u, v, m});
    }
    std::stable_sort(list.begin(), list.end(),
                     [](const Crossing& a, const Crossing& b) { return a.meeting > b.meeting; });
    return list;
  }

  void lift_unknowns() {
    const std::vector<Crossing> list = crossings();
    if (list.empty()) return;
    const std::vector<double> cost = costs_to_root();
    std::vector<Index> edges(at(old_.n), 0);
    for (const Crossing& c : list) {
      ++edges[at(c.u)];
      ++edges[at(c.v)];
    }
    std::map<Index, Index> from;  // of those that were lifted
    const auto front_before = [&](Index u) {
      const auto found = from.find(u);
      return found == from.end() ? front_[at(u)] : found->second;
    };
    for (const Crossing& c : list) {
      const Index f = front_[at(c.u)], g = front_[at(c.v)], m = meeting(f, g);
      if (m == f || m == g) continue;
      const auto price = [&](Index u) {
        return (cost[at(front_before(u))] - cost[at(m)]) / static_cast<double>(edges[at(u)]);
      };
      const double of_u = price(c.u), of_v = price(c.v);
      const Index lifted = of_u < of_v || (of_u == of_v && c.u < c.v) ? c.u : c.v;
      Index& its = front_[at(lifted)];
      from.emplace(lifted, its);
      touched_[at(its)] |= kRows | kEntries | kPivots;
      touched_[at(m)] |= kRows | kEntries | kPivots;
      --pivots_[at(its)];
      ++pivots_[at(m)];
      its = m;
    }
    out_.moved = static_cast<Index>(from.size());
    for (const auto& [v, f] : from) add_rows_of(v, f);
  }

  // An unknown that went up is a row of those fronts on its way that have its neighbours.
  void add_rows_of(Index v, Index from) {
    const Index end = front_[at(v)];
    visit_neighbours(v, [&](Index u) {
      const Index f = front_[at(u)];
      if (f < from || f >= end || meeting(from, f) != f) return;
      rows_to_add_.emplace_back(u, v);
      touched_[at(f)] |= kRows | kEntries | kMoved;
    });
  }

  // The front in which the neighbours of v meet that stand below its own; -1: there are none.
  [[nodiscard]] Index meeting_below(Index v) const {
    const Index f = front_[at(v)];
    Index m = -1;
    visit_neighbours(v, [&](Index u) {
      const Index g = front_[at(u)];
      if (g < f) m = m < 0 ? g : meeting(m, g);
    });
    return m < f ? m : -1;
  }

  // Unknowns that have lost an edge and do not hold anything apart any more: what a crack has passed, a contact that
  // has opened. The lowest come first, since those above stand over them then.
  [[nodiscard]] std::vector<std::pair<Index, Index>> idle_unknowns() const {
    std::vector<Index> ends;
    for (const auto& [u, v] : change_.removed) {
      ends.push_back(u);
      ends.push_back(v);
    }
    std::sort(ends.begin(), ends.end());
    ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
    std::vector<std::pair<Index, Index>> list;
    for (const Index v : ends)
      if (const Index m = meeting_below(v); m >= 0) list.emplace_back(m, v);
    std::sort(list.begin(), list.end());
    return list;
  }

  // Whether v is less work in front g, below its own: there it has the rows that g has, and its neighbours above g,
  // which the fronts on the way have as new rows, as far as they do not have them; they lose v. In its own front it has
  // all of the others.
  [[nodiscard]] bool is_cheaper_in(Index g, Index v, const std::vector<double>& cost,
                                   const std::vector<Index>& place) const {
    const Index f = front_[at(v)];
    const auto rows_of_before = [&](Index p) {
      return std::span(old_.rows.data() + old_.row_ptr[at(was_[at(p)])], at(old_.rows_below(was_[at(p)])));
    };
    double rows = 0, of_new = 0;
    for (const Index r : rows_of_before(g)) rows += front_[at(old_.order[at(r)])] > g ? 1 : 0;
    visit_neighbours(v, [&](Index u) {
      if (u == v || front_[at(u)] < f) return;
      const auto has_row = [&](Index p) {
        const auto list = rows_of_before(p);
        return std::binary_search(list.begin(), list.end(), place[at(u)]);
      };
      rows += has_row(g) ? 0 : 1;
      for (Index p = g; p != f && !has_row(p); p = parent_[at(p)]) of_new += cost[at(p)] - cost[at(parent_[at(p)])];
    });
    const double own = pivots_[at(f)] + old_.rows_below(was_[at(f)]);
    return rows * rows + 2 * (of_new - (cost[at(parent_[at(g)])] - cost[at(f)])) < own * own;
  }

  // They go down to where their neighbours meet.
  void lower_unknowns() {
    const std::vector<std::pair<Index, Index>> list = idle_unknowns();
    if (list.empty()) return;
    const std::vector<double> cost = costs_to_root();
    std::vector<Index> place(at(old_.n));  // of before
    each_column([&](std::size_t k) { place[at(old_.order[k])] = static_cast<Index>(k); });
    for (const auto& [unused, v] : list) {
      const Index f = front_[at(v)], g = meeting_below(v);
      if (g < 0 || !is_cheaper_in(g, v, cost, place)) continue;
      touched_[at(f)] |= kRows | kEntries | kPivots;
      touched_[at(g)] |= kRows | kEntries | kPivots;
      --pivots_[at(f)];
      ++pivots_[at(g)];
      front_[at(v)] = g;
      lowered_.push_back(v);
    }
    for (const Index v : lowered_)
      visit_neighbours(v, [&](Index u) {
        if (front_[at(u)] > front_[at(v)]) rows_to_add_.emplace_back(v, u);
      });
  }

  // An edge is a row of the lower of its two fronts.
  void touch_ends(std::span<const Edge> edges) {
    for (const auto& [u, v] : edges) touched_[at(std::min(front_[at(u)], front_[at(v)]))] |= kRows | kEntries;
  }

  // Fronts without pivots vanish; those that are left stand in postorder, siblings as before.
  // @param always  they may stand in another order
  void drop_and_sort(bool always) {
    const auto fronts = static_cast<Index>(parent_.size());
    bool all_stay = true;
    for (Index f = fronts; f-- > 0;) {  // those above have settled whom they stand for
      Index& up = parent_[at(f)];
      if (up >= 0 && pivots_[at(up)] == 0) up = parent_[at(up)];
      if (pivots_[at(f)] > 0) continue;
      all_stay = false;
      if (up >= 0) touched_[at(up)] |= kRows;
    }
    if (all_stay && !always) return;
    name_.assign(parent_.size(), -1);
    std::vector<Index> head(parent_.size() + 1, -1), next(parent_.size(), -1), sorted;
    for (Index f = fronts; f-- > 0;) {
      if (pivots_[at(f)] == 0) continue;
      Index& first = head[parent_[at(f)] < 0 ? parent_.size() : at(parent_[at(f)])];
      next[at(f)] = first;
      first = f;
    }
    std::vector<Index> stack;
    const auto descend = [&](Index f) {
      for (; f >= 0; f = head[at(f)]) stack.push_back(f);
    };
    descend(head.back());
    while (!stack.empty()) {
      const Index f = stack.back();
      stack.pop_back();
      name_[at(f)] = static_cast<Index>(sorted.size());
      sorted.push_back(f);
      descend(next[at(f)]);
    }
    rename(sorted);
  }

  void rename(const std::vector<Index>& sorted) {
    std::vector<Index> parent, was, pivots;
    std::vector<char> touched;
    for (const Index f : sorted) {
      parent.push_back(parent_[at(f)] < 0 ? -1 : name_[at(parent_[at(f)])]);
      touched.push_back(touched_[at(f)]);
      was.push_back(was_[at(f)]);
      pivots.push_back(pivots_[at(f)]);
    }
    each_column([&](std::size_t c) { front_[c] = name_[at(front_[c])]; });
    parent_ = std::move(parent);
    touched_ = std::move(touched);
    was_ = std::move(was);
    pivots_ = std::move(pivots);
  }

  // Pivots that stay keep their order; those that came stand behind them, in the order that they had.
  void take_pivots() {
    AssemblyTree& t = out_.tree;
    t.n = old_.n;
    t.parent = parent_;
    t.first.assign(parent_.size() + 1, 0);
    std::partial_sum(pivots_.begin(), pivots_.end(), t.first.begin() + 1);
    t.order.resize(at(t.n));
    position_.resize(at(t.n));
    std::vector<Index> now(at(old_.fronts()), -1), next(parent_.size());
    for (std::size_t f = 0; f < was_.size(); ++f) now[at(was_[f])] = static_cast<Index>(f);
    each_front(t.fronts(), [&](Index f) {
      const Index o = was_[at(f)];
      Index to = t.first[at(f)];
      for (Index k = old_.first[at(o)]; k < old_.first[at(o) + 1]; ++k)
        if (const Index v = old_.order[at(k)]; front_[at(v)] == f) t.order[at(to++)] = v;
      next[at(f)] = to;
    });
    for (Index o = 0; o < old_.fronts(); ++o) {
      if (now[at(o)] >= 0 && (touched_[at(now[at(o)])] & kPivots) == 0) continue;
      for (Index k = old_.first[at(o)]; k < old_.first[at(o) + 1]; ++k)
        if (const Index v = old_.order[at(k)], f = front_[at(v)]; f != now[at(o)]) t.order[at(next[at(f)]++)] = v;
    }
    each_column([&](std::size_t k) { position_[at(t.order[k])] = static_cast<Index>(k); });
  }

  template <class Use>
  void visit_neighbours(Index v, Use&& use) const {
    analysis::visit_neighbours(change_, column_of_row_, v, use);
  }

  const AssemblyTree& old_;
  const PatternChange& change_;
  base::ThreadPool& pool_;
  std::vector<Index> parent_;         // fronts as they are numbered now
  std::vector<Index> front_;          // by unknown
  std::vector<Index> pivots_;         // fronts; their number
  std::vector<char> touched_;         // fronts; kRows ...
  std::vector<Index> was_;            // fronts; their numbers in old_
  std::vector<Index> name_;           // by the numbers before the last drop_and_sort()
  std::vector<Index> position_;       // by unknown
  std::vector<Index> column_of_row_;  // empty: identity
  std::vector<Index> lowered_;        // unknowns
  std::vector<Edge> rows_to_add_;     // edges of which the upper end may be a new row of the lower one's front
  bool joined_ = false;
  ChangedTree out_;
};

}  // namespace

ChangedTree change_tree(const AssemblyTree& before, const PatternChange& change, base::ThreadPool& pool) {
  return TreeChange(before, change, pool).run();
}

}  // namespace espalier::analysis
