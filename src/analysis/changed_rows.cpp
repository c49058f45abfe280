#include "analysis/changed_rows.hpp"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <utility>

namespace espalier::analysis {

namespace {

class ChangedRows {
  using Edge = PatternChange::Edge;
  static constexpr std::int64_t kFronts = 256;  // per range of a loop

 public:
  ChangedRows(const FollowedFronts& f, ChangedTree& out, base::ThreadPool& pool)
      : old_(f.before),
        change_(f.change),
        was_(f.was),
        front_(f.front),
        position_(f.position),
        column_of_row_(f.column_of_row),
        touched_(f.touched),
        new_rows_(f.new_rows),
        out_(out),
        pool_(pool) {}

  void run() {
    AssemblyTree& t = out_.tree;
    const auto fronts = at(t.fronts());
    for (const auto& [u, v] : new_rows_) {
      const bool lower = position_[at(u)] < position_[at(v)];
      added_.emplace_back(front_[at(lower ? u : v)], position_[at(lower ? v : u)]);
    }
    std::sort(added_.begin(), added_.end());
    added_.erase(std::unique(added_.begin(), added_.end()), added_.end());
    rows_.resize(fronts);
    known_.assign(fronts, 0);
    changed_.assign(fronts, 0);
    out_.same = was_;
    out_.with_pivots = was_;
    for (std::size_t f = 0; f < fronts; ++f)
      if ((touched_[f] & (kPivots | kMoved)) != 0) out_.with_pivots[f] = -1;
    for (const std::vector<Index>& list : by_height()) {
      constexpr std::int64_t kSome = 8, kMany = 256;
      const auto all = static_cast<std::int64_t>(list.size());
      alone_ = all == 1;  // all threads are at its front, most often a large one
      if (alone_)
        remake(list.front());
      else
        pool_.for_each_range(all, all < kMany ? 1 : kSome, [&](std::int64_t b, std::int64_t e) {
          for (std::int64_t k = b; k < e; ++k) remake(list[at(k)]);
        });
    }
    alone_ = false;
    t.row_ptr.resize(fronts + 1);
    t.row_ptr[0] = 0;
    for (std::size_t f = 0; f < fronts; ++f)
      t.row_ptr[f + 1] =
          t.row_ptr[f] + (known_[f] != 0 ? static_cast<Offset>(rows_[f].size()) : old_.rows_below(was_[f]));
    t.rows.resize(at(t.row_ptr.back()));
    pool_.for_each_range(t.fronts(), kFronts, [&](std::int64_t b, std::int64_t e) {
      for (auto f = static_cast<Index>(b); f < e; ++f) {
        if (known_[at(f)] == 0) keep_rows(f);
        std::copy(rows_[at(f)].begin(), rows_[at(f)].end(), t.rows.begin() + t.row_ptr[at(f)]);
        rows_[at(f)] = {};
      }
    });
    out_.kept = static_cast<Index>(std::count(changed_.begin(), changed_.end(), 0));
  }

 private:
  // The rows of a front as it was, by the positions of now, in the order of then.
  [[nodiscard]] std::vector<Index> rows_before(Index f) const {
    const Index o = was_[at(f)];
    std::vector<Index> rows;
    rows.reserve(at(old_.rows_below(o)));
    for (Offset r = old_.row_ptr[at(o)]; r < old_.row_ptr[at(o) + 1]; ++r)
      rows.push_back(position_[at(old_.order[at(old_.rows[at(r)])])]);
    return rows;
  }

  template <class Use>
  void visit_neighbours(Index v, Use&& use) const {
    analysis::visit_neighbours(change_, column_of_row_, v, use);
  }

  // Keeps the rows of a front that has not changed, in the order of now.
  void keep_rows(Index f) {
    std::vector<Index>& list = rows_[at(f)] = rows_before(f);
    known_[at(f)] = 1;
    if (std::is_sorted(list.begin(), list.end())) return;
    std::sort(list.begin(), list.end());
    out_.same[at(f)] = -1;
  }

  [[nodiscard]] bool has_pivot_beside(Index f, Index row) const {
    bool found = false;
    visit_neighbours(out_.tree.order[at(row)], [&](Index u) { found = found || front_[at(u)] == f; });
    return found;
  }

  // Positions behind the pivots of f, from the next one on; 1: an entry joins it with one of them.
  [[nodiscard]] std::vector<char> beside_pivots(Index f) const {
    constexpr std::int64_t kPivots = 64;
    const AssemblyTree& t = out_.tree;
    const Index first = t.first[at(f)], last = t.first[at(f) + 1] - 1;
    std::vector<char> beside(at(t.n - last - 1), 0);
    const auto mark_neighbours = [&](std::int64_t begin, std::int64_t end) {
      for (auto k = begin; k < end; ++k)
        visit_neighbours(t.order[at(first + k)], [&](Index v) {
          if (position_[at(v)] <= last) return;
          const std::atomic_ref<char> mark(beside[at(position_[at(v)] - last - 1)]);
          if (mark.load(std::memory_order_relaxed) == 0) mark.store(1, std::memory_order_relaxed);
        });
    };
    if (alone_)
      pool_.for_each_range(t.pivots(f), kPivots, mark_neighbours);
    else
      mark_neighbours(0, t.pivots(f));
    return beside;
  }

  // Adds to `rows` those of `more` that lie above `last`; both ascend.
  static void unite(std::vector<Index>& rows, std::span<const Index> more, Index last) {
    more = more.subspan(at(std::upper_bound(more.begin(), more.end(), last) - more.begin()));
    if (std::includes(rows.begin(), rows.end(), more.begin(), more.end())) return;
    std::vector<Index> both;
    both.reserve(rows.size() + more.size());
    std::set_union(rows.begin(), rows.end(), more.begin(), more.end(), std::back_inserter(both));
    rows = std::move(both);
  }

  // Rows that children have and that edges bring, which came, or moved with an unknown. An edge that was there before
  // and joins one of the front's pivots with a row above is a row of before.
  [[nodiscard]] std::vector<Index> rows_of(Index f, std::span<const Index> before) {
    const AssemblyTree& t = out_.tree;
    const Index last = t.first[at(f) + 1] - 1;
    std::vector<Index> rows, more, candidates;
    for (Offset c = child_ptr_[at(f)]; c < child_ptr_[at(f) + 1]; ++c) {
      const Index child = children_[at(c)];
      if (known_[at(child)] == 0) keep_rows(child);
      unite(rows, rows_[at(child)], last);
    }
    for (auto e = std::lower_bound(added_.begin(), added_.end(), Edge{f, 0}); e != added_.end() && e->first == f; ++e)
      more.push_back(e->second);
    unite(rows, more, last);
    std::set_difference(before.begin(), before.end(), rows.begin(), rows.end(), std::back_inserter(candidates));
    more.clear();
    if (static_cast<Index>(candidates.size()) <= t.pivots(f)) {
      for (const Index r : candidates)
        if (r > last && has_pivot_beside(f, r)) more.push_back(r);
    } else {
      const std::vector<char> beside = beside_pivots(f);
      for (const Index r : candidates)
        if (r > last && beside[at(r - last - 1)] != 0) more.push_back(r);
    }
    unite(rows, more, last);
    return rows;
  }

  void remake(Index f) {
    if ((touched_[at(f)] & (kEntries | kPivots)) != 0) out_.same[at(f)] = -1;
    if ((touched_[at(f)] & kRows) == 0) return;
    keep_rows(f);
    std::vector<Index> made = rows_of(f, rows_[at(f)]);
    const bool other = made != rows_[at(f)];
    if (other || (touched_[at(f)] & kPivots) != 0) changed_[at(f)] = 1;
    if (!other) return;
    out_.same[at(f)] = -1;
    rows_[at(f)] = std::move(made);
    if (const Index up = out_.tree.parent[at(f)]; up >= 0)
      std::atomic_ref<char>(touched_[at(up)]).fetch_or(kRows, std::memory_order_relaxed);
  }

  // Children of each front, and the fronts by their height above the leaves: those of one height are independent.
  [[nodiscard]] std::vector<std::vector<Index>> by_height() {
    const auto fronts = out_.tree.parent.size();
    child_ptr_.assign(fronts + 1, 0);
    for (const Index p : out_.tree.parent)
      if (p >= 0) ++child_ptr_[at(p) + 1];
    std::partial_sum(child_ptr_.begin(), child_ptr_.end(), child_ptr_.begin());
    children_.resize(at(child_ptr_.back()));
    std::vector<Offset> next(child_ptr_.begin(), child_ptr_.end() - 1);
    std::vector<Index> height(fronts, 0);
    std::vector<std::vector<Index>> list;
    for (std::size_t f = 0; f < fronts; ++f) {
      if (list.size() <= at(height[f])) list.emplace_back();
      list[at(height[f])].push_back(static_cast<Index>(f));
      if (out_.tree.parent[f] < 0) continue;
      children_[at(next[at(out_.tree.parent[f])]++)] = static_cast<Index>(f);
      height[at(out_.tree.parent[f])] = std::max(height[at(out_.tree.parent[f])], height[f] + 1);
    }
    return list;
  }

  const AssemblyTree& old_;
  const PatternChange& change_;
  const std::vector<Index>& was_;            // fronts; their numbers in old_
  const std::vector<Index>& front_;          // by unknown
  const std::vector<Index>& position_;       // by unknown
  const std::vector<Index>& column_of_row_;  // empty: identity
  std::vector<char>& touched_;               // fronts; FrontChange
  std::span<const Edge> new_rows_;
  ChangedTree& out_;
  base::ThreadPool& pool_;
  std::vector<Edge> added_;        // new_rows_ as fronts and positions, ascending
  std::vector<Offset> child_ptr_;  // fronts + 1
  std::vector<Index> children_;
  std::vector<std::vector<Index>> rows_;  // fronts; of those that are known
  std::vector<char> known_, changed_;     // fronts
  bool alone_ = false;                    // one thread makes one front; the others wait
};

}  // namespace

void make_rows(const FollowedFronts& fronts, ChangedTree& out, base::ThreadPool& pool) {
  ChangedRows(fronts, out, pool).run();
}

}  // namespace espalier::analysis
