#include "analysis/tree_change.hpp"

#include <algorithm>
#include <numeric>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

constexpr std::int64_t kFronts = 256;  // per range of a loop

class TreeChange {
 public:
  TreeChange(const AssemblyTree& before, const PatternChange& change, base::ThreadPool& pool)
      : old_(before),
        change_(change),
        pool_(pool),
        parent_(before.parent),
        front_(at(before.n)),
        touched_(at(before.fronts()), 0),
        was_(at(before.fronts())) {
    std::iota(was_.begin(), was_.end(), 0);
    for (Index f = 0; f < old_.fronts(); ++f)
      for (Index k = old_.first[at(f)]; k < old_.first[at(f) + 1]; ++k) front_[at(old_.order[at(k)])] = f;
    column_of_row_.resize(change.row_of_col.size());
    for (std::size_t c = 0; c < change.row_of_col.size(); ++c)
      column_of_row_[at(change.row_of_col[c])] = static_cast<Index>(c);
  }

  ChangedTree run() {
    join_trees();
    if (joined_) drop_and_sort();  // ways to the root are followed by rising numbers
    lift_unknowns();
    touch_ends();
    drop_and_sort();
    take_pivots();
    make_rows();
    return std::move(out_);
  }

 private:
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
      touched_[at(std::min(a, b))] = touched_[at(std::max(a, b))] = 1;
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
    std::vector<Index> from(front_);
    for (const Crossing& c : list) {
      const Index f = front_[at(c.u)], g = front_[at(c.v)], m = meeting(f, g);
      if (m == f || m == g) continue;
      const auto price = [&](Index u) {
        return (cost[at(from[at(u)])] - cost[at(m)]) / static_cast<double>(edges[at(u)]);
      };
      const double of_u = price(c.u), of_v = price(c.v);
      const Index lifted = of_u < of_v || (of_u == of_v && c.u < c.v) ? c.u : c.v;
      touched_[at(front_[at(lifted)])] = touched_[at(m)] = 1;
      if (front_[at(lifted)] == from[at(lifted)]) ++out_.moved;
      front_[at(lifted)] = m;
    }
  }

  // An edge is a row of the lower of its two fronts.
  void touch_ends() {
    for (const auto* list : {&change_.added, &change_.removed})
      for (const auto& [u, v] : *list) touched_[at(std::min(front_[at(u)], front_[at(v)]))] = 1;
    for (const Index v : change_.diagonal) touched_[at(front_[at(v)])] = 1;
  }

  // Fronts without pivots vanish; those that are left stand in postorder, siblings as before.
  void drop_and_sort() {
    std::vector<Index> pivots(parent_.size(), 0);
    for (const Index f : front_) ++pivots[at(f)];
    const auto fronts = static_cast<Index>(parent_.size());
    for (Index f = fronts; f-- > 0;) {  // those above have settled whom they stand for
      Index& up = parent_[at(f)];
      if (up >= 0 && pivots[at(up)] == 0) up = parent_[at(up)];
      if (pivots[at(f)] == 0 && up >= 0) touched_[at(up)] = 1;
    }
    name_.assign(parent_.size(), -1);
    std::vector<Index> head(parent_.size() + 1, -1), next(parent_.size(), -1), sorted;
    for (Index f = fronts; f-- > 0;) {
      if (pivots[at(f)] == 0) continue;
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
    std::vector<Index> parent, was;
    std::vector<char> touched;
    for (const Index f : sorted) {
      parent.push_back(parent_[at(f)] < 0 ? -1 : name_[at(parent_[at(f)])]);
      touched.push_back(touched_[at(f)]);
      was.push_back(was_[at(f)]);
    }
    for (Index& f : front_) f = name_[at(f)];
    parent_ = std::move(parent);
    touched_ = std::move(touched);
    was_ = std::move(was);
  }

  // Pivots that stay keep their order; those that came stand behind them.
  void take_pivots() {
    AssemblyTree& t = out_.tree;
    t.n = old_.n;
    t.parent = parent_;
    t.first.assign(parent_.size() + 1, 0);
    for (const Index f : front_) ++t.first[at(f) + 1];
    std::partial_sum(t.first.begin(), t.first.end(), t.first.begin());
    t.order.resize(at(t.n));
    std::vector<Index> next(t.first.begin(), t.first.end() - 1);
    for (const bool stays : {true, false})
      for (Index f = 0; f < old_.fronts(); ++f)
        for (Index k = old_.first[at(f)]; k < old_.first[at(f) + 1]; ++k) {
          const Index v = old_.order[at(k)], now = front_[at(v)];
          if ((was_[at(now)] == f) == stays) t.order[at(next[at(now)]++)] = v;
        }
    position_.resize(at(t.n));
    for (Index k = 0; k < t.n; ++k) position_[at(t.order[at(k)])] = k;
  }

  // The rows of a front as it was, by the positions of now, in the order of then.
  [[nodiscard]] std::vector<Index> rows_before(Index f) const {
    const Index o = was_[at(f)];
    std::vector<Index> rows;
    rows.reserve(at(old_.rows_below(o)));
    for (Offset r = old_.row_ptr[at(o)]; r < old_.row_ptr[at(o) + 1]; ++r)
      rows.push_back(position_[at(old_.order[at(old_.rows[static_cast<std::size_t>(r)])])]);
    return rows;
  }

  template <class Use>
  void visit_neighbours(Index v, Use&& use) const {
    const MatrixView& a = change_.a;
    for (Offset q = a.col_ptr[at(v)]; q < a.col_ptr[at(v) + 1]; ++q) {
      const Index r = a.row_ind[static_cast<std::size_t>(q)];
      use(column_of_row_.empty() ? r : column_of_row_[at(r)]);
    }
    const auto& ptr = change_.rows.ptr;
    if (ptr.empty()) return;
    const std::size_t row = at(change_.row_of_col.empty() ? v : change_.row_of_col[at(v)]);
    for (Offset q = ptr[row]; q < ptr[row + 1]; ++q) use(change_.rows.col[q]);
  }

  void make_rows() {
    AssemblyTree& t = out_.tree;
    const auto fronts = at(t.fronts());
    std::vector<std::vector<Index>> rows(fronts);
    out_.same = was_;
    pool_.for_each_range(t.fronts(), kFronts, [&](std::int64_t b, std::int64_t e) {
      for (auto f = static_cast<Index>(b); f < e; ++f) {
        std::vector<Index>& list = rows[at(f)] = rows_before(f);
        if (std::is_sorted(list.begin(), list.end())) continue;
        std::sort(list.begin(), list.end());
        out_.same[at(f)] = -1;
      }
    });
    std::vector<std::vector<Index>> children(fronts);
    for (Index f = 0; f < t.fronts(); ++f)
      if (t.parent[at(f)] >= 0) children[at(t.parent[at(f)])].push_back(f);
    std::vector<Index> mark(at(t.n), -1), made;
    for (Index f = 0; f < t.fronts(); ++f) {
      if (touched_[at(f)] == 0) {
        ++out_.kept;
        continue;
      }
      made.clear();
      out_.same[at(f)] = -1;
      const Index last = t.first[at(f) + 1] - 1;
      const auto add = [&](Index p) {
        if (p <= last || mark[at(p)] == f) return;
        mark[at(p)] = f;
        made.push_back(p);
      };
      for (const Index c : children[at(f)])
        for (const Index p : rows[at(c)]) add(p);
      for (Index k = t.first[at(f)]; k <= last; ++k)
        visit_neighbours(t.order[at(k)], [&](Index v) { add(position_[at(v)]); });
      std::sort(made.begin(), made.end());
      if (made == rows[at(f)]) continue;
      rows[at(f)] = made;
      if (t.parent[at(f)] >= 0) touched_[at(t.parent[at(f)])] = 1;
    }
    t.row_ptr.assign(1, 0);
    for (const auto& list : rows) t.row_ptr.push_back(t.row_ptr.back() + static_cast<Offset>(list.size()));
    t.rows.resize(static_cast<std::size_t>(t.row_ptr.back()));
    pool_.for_each_range(t.fronts(), kFronts, [&](std::int64_t b, std::int64_t e) {
      for (auto f = static_cast<std::size_t>(b); f < static_cast<std::size_t>(e); ++f)
        std::copy(rows[f].begin(), rows[f].end(), t.rows.begin() + t.row_ptr[f]);
    });
  }

  const AssemblyTree& old_;
  const PatternChange& change_;
  base::ThreadPool& pool_;
  std::vector<Index> parent_;         // fronts as they are numbered now
  std::vector<Index> front_;          // by unknown
  std::vector<char> touched_;         // fronts
  std::vector<Index> was_;            // fronts; their numbers in old_
  std::vector<Index> name_;           // by the numbers before the last drop_and_sort()
  std::vector<Index> position_;       // by unknown
  std::vector<Index> column_of_row_;  // empty: identity
  bool joined_ = false;
  ChangedTree out_;
};

}  // namespace

ChangedTree change_tree(const AssemblyTree& before, const PatternChange& change, base::ThreadPool& pool) {
  return TreeChange(before, change, pool).run();
}

}  // namespace espalier::analysis
