#include "plan/entry_places.hpp"

#include <algorithm>
#include <atomic>
#include <numeric>
#include <vector>

#include "base/lazy_vector.hpp"
#include "plan/changed_entries.hpp"
#include "plan/kept_entries.hpp"
#include "plan/rank_parts.hpp"

namespace espalier::plan {

namespace {

constexpr std::int64_t kFrontsPerRange = 256;
constexpr Offset kEntriesPerDraw = 1 << 15;

// The matrix by positions of the elimination.
struct Permuted {
  const MatrixView& a;
  const matrix::RowIndex& rows;
  const std::vector<Index>& order;       // column by position
  const std::vector<Index>& row_of_col;  // empty: identity
  bool unsymmetric;
  base::LazyVector<Index> column_position, matched_position;
  std::span<const Index> row_position;  // of either

  // Calls use(source, row position, transposed) for the entries that belong to position k. An entry is found in its
  // column when that is the lower of its positions, else in its row.
  template <class Use>
  void visit(Index k, Use&& use) const {
    constexpr Offset kAhead = 16;  // entries between asking for a position and using it
    const Index c = order[k];
    const bool both = a.storage == Storage::symmetric_both;
    for (Offset q = a.col_ptr[c], end = a.col_ptr[c + 1]; q < end; ++q) {
      __builtin_prefetch(&row_position[a.row_ind[std::min(q + kAhead, end - 1)]]);
      const Index r = a.row_ind[q];
      if (both && r < c) continue;  // the lower triangle stands for both
      if (const Index p = row_position[r]; p >= k) use(q, p, false);
    }
    const Index r = row_of_col.empty() ? c : row_of_col[c];
    for (Offset q = rows.ptr[r], end = rows.ptr[r + 1]; q < end; ++q) {
      __builtin_prefetch(&column_position[rows.col[std::min(q + kAhead, end - 1)]]);
      if (const Index p = column_position[rows.col[q]]; p > k) use(rows.source[q], p, unsymmetric);
    }
  }
};

// Whether the entries of position k, a pivot of front f, belong to this rank's part of the plan.
bool holds_entries(const Plan& plan, Index f, Index k) {
  return is_made_here(plan, f, plan.layout[f].tile_of(k - plan.tree.first[f]));
}

// The entries of one front at a time, sorted.
class FrontEntries {
 public:
  FrontEntries(const Plan& plan, const Permuted& permuted, const ChangedEntries& changed)
      : plan_(plan),
        permuted_(permuted),
        changed_(changed),
        local_(static_cast<std::size_t>(plan.tree.n + plan.tree.border), -1) {}

  // Collects the columns of front f that are made here: in each, rows ascending, duplicates by source.
  void collect(Index f) {
    if (changed_.front_before(f) >= 0) return changed_.collect(f, list_, ptr_);
    list_.clear();
    ptr_.assign(1, 0);
    for (Index k = plan_.tree.first[f]; k < plan_.tree.first[f + 1]; ++k) {
      if (holds_entries(plan_, f, k))
        permuted_.visit(k, [&](Offset q, Index row, bool transposed) { list_.push_back({q, row, transposed}); });
      std::sort(list_.begin() + static_cast<std::ptrdiff_t>(ptr_.back()), list_.end(),
                [](const PermutedEntry& x, const PermutedEntry& y) {
                  return x.row != y.row ? x.row < y.row : x.source < y.source;
                });
      ptr_.push_back(list_.size());
    }
  }

  [[nodiscard]] Offset size() const { return static_cast<Offset>(list_.size()); }

  // Calls use(tile, entry) for every entry collected, columns ascending.
  template <class Use>
  void visit(Index f, Use&& use) {
    const FrontLayout& layout = plan_.layout[f];
    number_rows(f);
    for (Index col = 0; col < layout.pivots; ++col) {
      const Index j = layout.tile_of(col);
      const Index first = layout.begin(j);
      Index i = j, begin = first, end = layout.begin(j + 1);  // rows ascend within a column, and so do their tiles
      each_of_column(f, col, [&](const PermutedEntry& e, Index row) {
        for (; row >= end; end = layout.begin(i + 1)) begin = layout.begin(++i);
        use(layout.tile_index(i, j), EntryPlace(e.source, row - begin, col - first, e.transposed));
      });
    }
  }

  // The same for a front taken whole: all entries in one tile.
  template <class Use>
  void visit_whole(Index f, Use&& use) {
    number_rows(f);
    for (Index col = 0; col < plan_.layout[f].pivots; ++col)
      each_of_column(f, col,
                     [&](const PermutedEntry& e, Index row) { use(EntryPlace(e.source, row, col, e.transposed)); });
  }

 private:
  void number_rows(Index f) {
    const auto& t = plan_.tree;
    for (Offset r = t.row_ptr[f]; r < t.row_ptr[f + 1]; ++r)
      local_[t.rows[r]] = plan_.layout[f].pivots + static_cast<Index>(r - t.row_ptr[f]);
  }
  template <class Use>
  void each_of_column(Index f, Index col, Use&& use) const {
    const Index first = plan_.tree.first[f], end = plan_.tree.first[f + 1];
    for (std::size_t q = ptr_[static_cast<std::size_t>(col)]; q < ptr_[static_cast<std::size_t>(col) + 1]; ++q)
      use(list_[q], list_[q].row < end ? list_[q].row - first : local_[list_[q].row]);
  }

  const Plan& plan_;
  const Permuted& permuted_;
  const ChangedEntries& changed_;
  std::vector<PermutedEntry> list_;
  std::vector<std::size_t> ptr_;  // pivots + 1: each column's part of the list
  std::vector<Index> local_;      // position -> row of the current front, valid for its rows below
};

// Where each front's entries begin (fronts + 1): all entries of a front stand together. Fronts ascend like positions,
// so an entry belongs to the lower front of its row and its column. The border counts as a front behind the last.
std::vector<Offset> count_entries(const Plan& plan, const Permuted& permuted, base::ThreadPool& pool) {
  constexpr std::int64_t kColumns = 4096;  // per range
  const MatrixView& a = permuted.a;
  const auto& t = plan.tree;
  const Index all = t.n + t.border;
  std::vector<Index> of_position(static_cast<std::size_t>(all), plan.fronts()), of_row(of_position.size());
  pool.for_each_range(plan.fronts(), kFrontsPerRange, [&](std::int64_t b, std::int64_t e) {
    for (auto f = static_cast<Index>(b); f < e; ++f)
      std::fill(of_position.begin() + t.first[f], of_position.begin() + t.first[f + 1], f);
  });
  pool.for_each_range(all, kColumns, [&](std::int64_t b, std::int64_t e) {
    for (std::int64_t r = b; r < e; ++r) of_row[r] = of_position[permuted.row_position[r]];
  });
  std::vector<Offset> begin(static_cast<std::size_t>(plan.fronts()) + 2, 0);
  const bool both = a.storage == Storage::symmetric_both;
  pool.for_each_range(all, kColumns, [&](std::int64_t b, std::int64_t e) {
    for (auto c = static_cast<Index>(b); c < e; ++c) {
      const Index mine = of_position[permuted.column_position[c]];
      Index front = mine;
      Offset count = 0;  // of the entries of `front` since it was last another one
      const auto add = [&] {
        std::atomic_ref<Offset>(begin[front + 1]).fetch_add(count, std::memory_order_relaxed);
        count = 0;
      };
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
        if (both && a.row_ind[q] < c) continue;
        if (const Index next = std::min(mine, of_row[a.row_ind[q]]); next != front) {
          add();
          front = next;
        }
        ++count;
      }
      add();
    }
  });
  begin.pop_back();
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  return begin;
}

// The front before whose entries this one has, in the same tiles; -1: none.
Index kept_front(const Plan& plan, Index f, const KeptEntries* kept) {
  const Index old = kept == nullptr ? -1 : kept->same[f];
  if (old < 0) return -1;
  const FrontLayout &l = plan.layout[f], &was = kept->before.layout[old];
  const bool same = l.pivots == was.pivots && l.rows == was.rows && l.pivot_width == was.pivot_width &&
                    l.below_width == was.below_width && plan.whole[f] == kept->before.whole[old];
  return same ? old : -1;
}

// The same where the entries of most fronts are known, or other ranks'.
std::vector<Offset> count_others(const Plan& plan, const Permuted& permuted, const KeptEntries* kept,
                                 const ChangedEntries& changed, base::ThreadPool& pool) {
  std::vector<Offset> begin(static_cast<std::size_t>(plan.fronts()) + 1, 0);
  pool.for_each_range(plan.fronts(), kFrontsPerRange, [&](std::int64_t b, std::int64_t e) {
    for (auto f = static_cast<Index>(b); f < e; ++f) {
      Offset& count = begin[f + 1];
      if (const Index old = kept_front(plan, f, kept); old >= 0) {
        const Plan& was = kept->before;
        count = was.entry_ptr[was.first_tile[old + 1]] - was.entry_ptr[was.first_tile[old]];
        continue;
      }
      if (changed.front_before(f) >= 0) {
        count = changed.count(f);
        continue;
      }
      for (Index k = plan.tree.first[f]; k < plan.tree.first[f + 1]; ++k)
        if (holds_entries(plan, f, k)) permuted.visit(k, [&](Offset, Index, bool) { ++count; });
    }
  });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  return begin;
}

Permuted permute(const Plan& plan, const EntrySource& from, base::ThreadPool& pool) {
  const std::vector<Index>& row_of_col = from.row_of_col;
  constexpr std::int64_t kPositions = 1 << 15;  // per range
  const auto n = static_cast<std::size_t>(plan.tree.n + plan.tree.border);
  Permuted p{from.a,
             from.rows,
             plan.tree.order,
             row_of_col,
             plan.options.unsymmetric,
             base::LazyVector<Index>(n),
             base::LazyVector<Index>(row_of_col.empty() ? 0 : n),
             {}};
  pool.for_each_range(plan.tree.n, kPositions, [&](std::int64_t b, std::int64_t e) {
    for (auto k = static_cast<Index>(b); k < e; ++k) p.column_position[plan.tree.order[k]] = k;
  });
  if (!row_of_col.empty())
    pool.for_each_range(plan.tree.n, kPositions, [&](std::int64_t b, std::int64_t e) {
      for (auto c = b; c < e; ++c) p.matched_position[row_of_col[c]] = p.column_position[c];
    });
  std::iota(p.column_position.begin() + plan.tree.n, p.column_position.end(), plan.tree.n);
  if (!row_of_col.empty()) std::iota(p.matched_position.begin() + plan.tree.n, p.matched_position.end(), plan.tree.n);
  p.row_position = row_of_col.empty() ? p.column_position : p.matched_position;
  return p;
}

// Writes the entries of front f from plan.entries[begin] on. at: scratch
void place_front(Plan& plan, Index f, Offset begin, FrontEntries& front, std::vector<Offset>& at) {
  const auto first = plan.entry_ptr.begin() + plan.first_tile[f];
  front.collect(f);
  at.assign(static_cast<std::size_t>(plan.layout[f].tile_count()) + 1, 0);
  at[0] = begin;
  if (plan.whole[f] != 0) {
    std::fill(at.begin() + 1, at.end(), begin + front.size());
    std::copy(at.begin(), at.end() - 1, first);
    front.visit_whole(f, [&](const EntryPlace& e) { plan.entries[begin++] = e; });
    return;
  }
  front.visit(f, [&](Offset tile, const EntryPlace&) { ++at[tile + 1]; });
  std::partial_sum(at.begin(), at.end(), at.begin());
  std::copy(at.begin(), at.end() - 1, first);
  front.visit(f, [&](Offset tile, const EntryPlace& e) { plan.entries[at[tile]++] = e; });
}

// Copies the entries of a front that is the same as before.
void keep_front(Plan& plan, Index f, Offset begin, const KeptEntries& kept) {
  const Plan& was = kept.before;
  const Index old = kept.same[f];
  const Offset tiles = plan.layout[f].tile_count(), tile = was.first_tile[old], first = was.entry_ptr[tile];
  const Offset end = was.entry_ptr[tile + tiles];
  for (Offset k = 0; k < tiles; ++k) plan.entry_ptr[plan.first_tile[f] + k] = was.entry_ptr[tile + k] - first + begin;
  SourceMap::Cursor now(kept.now);
  for (Offset k = 0; k < end - first; ++k) {
    const EntryPlace& e = was.entries[first + k];
    plan.entries[begin + k] = EntryPlace(now(e.source()), e.row(), e.col(), e.transposed());
  }
}

}  // namespace

void place_entries(Plan& plan, const EntrySource& from, base::ThreadPool& pool, const KeptEntries* kept) {
  const Permuted permuted = permute(plan, from, pool);
  const bool part = plan.options.ranks > 1;
  const ChangedEntries changed(plan, from.a, permuted.row_position, permuted.column_position, kept);
  const std::vector<Offset> begin =
      kept != nullptr || part ? count_others(plan, permuted, kept, changed, pool) : count_entries(plan, permuted, pool);
  plan.entry_ptr.resize(static_cast<std::size_t>(plan.tiles()) + 1);
  plan.entries.resize(static_cast<std::size_t>(begin.back()));
  std::vector<Index> draw{0};  // its first front; the large fronts at the end, most of them alone, are taken first
  for (Index f = 0; f < plan.fronts(); ++f)
    if (begin[f + 1] - begin[draw.back()] >= kEntriesPerDraw || f + 1 == plan.fronts()) draw.push_back(f + 1);
  std::atomic<std::size_t> taken{0};
  pool.share([&](int) {
    FrontEntries front(plan, permuted, changed);
    std::vector<Offset> at;
    for (;;) {
      const std::size_t p = ++taken;
      if (p >= draw.size()) return;
      for (Index f = draw[draw.size() - p - 1]; f < draw[draw.size() - p]; ++f)
        if (kept_front(plan, f, kept) >= 0)
          keep_front(plan, f, begin[f], *kept);
        else if (!part || knows(plan, f, plan.options.rank))
          place_front(plan, f, begin[f], front, at);
    }
  });
  plan.entry_ptr.back() = static_cast<Offset>(plan.entries.size());
}

void number_sources(Plan& plan, base::ThreadPool& pool) {
  constexpr std::int64_t kEntries = 1 << 15;  // per range
  plan.sources.resize(plan.entries.size());
  const auto each = [&](const auto& use) {
    pool.for_each_range(static_cast<std::int64_t>(plan.entries.size()), kEntries, [&](std::int64_t b, std::int64_t e) {
      for (auto k = static_cast<std::size_t>(b); k < static_cast<std::size_t>(e); ++k) use(k, plan.entries[k]);
    });
  };
  each([&](std::size_t k, const EntryPlace& e) { plan.sources[k] = e.source(); });
  std::sort(plan.sources.begin(), plan.sources.end());
  each([&](std::size_t, EntryPlace& e) {
    const auto at = std::lower_bound(plan.sources.begin(), plan.sources.end(), e.source()) - plan.sources.begin();
    e = EntryPlace(at, e.row(), e.col(), e.transposed());
  });
}

void place_entries_as_before(Plan& plan, const Plan& before, std::span<const Index> same, const EntrySource& from,
                             base::ThreadPool& pool) {
  const Permuted permuted = permute(plan, from, pool);
  const ChangedEntries changed(plan, from.a, permuted.row_position, permuted.column_position, nullptr);
  FrontEntries front(plan, permuted, changed);
  std::vector<Offset> at;
  plan.entry_ptr.resize(static_cast<std::size_t>(plan.tiles()) + 1);
  plan.entries.resize(before.entries.size());
  Offset begin = 0;
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Index old = same[f];
    if (old < 0) {
      place_front(plan, f, begin, front, at);
      begin += front.size();
      continue;
    }
    const Offset tile = before.first_tile[old], old_begin = before.entry_ptr[tile];
    const Offset end = before.entry_ptr[before.first_tile[old + 1]];
    for (Offset k = 0; k < plan.layout[f].tile_count(); ++k)
      plan.entry_ptr[plan.first_tile[f] + k] = before.entry_ptr[tile + k] - old_begin + begin;
    std::copy(before.entries.begin() + old_begin, before.entries.begin() + end, plan.entries.begin() + begin);
    begin += end - old_begin;
  }
  plan.entry_ptr.back() = begin;
}

}  // namespace espalier::plan
