#include "plan/changed_entries.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "base/at.hpp"

namespace espalier::plan {

namespace {

// Calls use(row of the front, column, entry) for all entries of a front, in each column rows ascending.
template <class Use>
void visit_entries(const Plan& plan, Index f, Use&& use) {
  const FrontLayout& l = plan.layout[at(f)];
  Offset tile = plan.first_tile[at(f)];
  const auto of_tile = [&](Offset t, Index first_row, Index first_column) {
    for (Offset k = plan.entry_ptr[at(t)]; k < plan.entry_ptr[at(t + 1)]; ++k) {
      const EntryPlace& e = plan.entries[at(k)];
      use(first_row + e.row(), first_column + e.col(), e);
    }
  };
  if (plan.whole[at(f)] != 0) return of_tile(tile, 0, 0);
  for (Index j = 0; j < l.pivot_tiles; ++j)
    for (Index i = j; i < l.tiles; ++i) of_tile(tile++, l.begin(i), l.begin(j));
}

}  // namespace

ChangedEntries::ChangedEntries(const Plan& plan, const MatrixView& a, std::span<const Index> row_position,
                               std::span<const Index> column_position, const KeptEntries* kept)
    : plan_(plan), column_position_(column_position), kept_(kept) {
  if (kept == nullptr || kept->with_pivots.empty()) return;
  const auto& first = plan.tree.first;
  const auto front_of = [&](Index position) {
    return static_cast<Index>(std::upper_bound(first.begin(), first.end(), position) - first.begin()) - 1;
  };
  const bool both = a.storage == Storage::symmetric_both;
  for (const auto& [row, col] : kept->added) {
    if (both && row < col) continue;  // the lower triangle stands for both
    const Index r = row_position[at(row)], c = column_position[at(col)], f = front_of(std::min(r, c));
    const auto rows = a.row_ind.subspan(at(a.col_ptr[at(col)]), at(a.col_ptr[at(col) + 1] - a.col_ptr[at(col)]));
    const Offset source = a.col_ptr[at(col)] + (std::find(rows.begin(), rows.end(), row) - rows.begin());
    added_.push_back({f, std::min(r, c) - first[at(f)], {source, std::max(r, c), r < c && plan.options.unsymmetric}});
  }
  std::sort(added_.begin(), added_.end(), [](const Added& x, const Added& y) {
    return std::tie(x.front, x.column, x.entry.row, x.entry.source) <
           std::tie(y.front, y.column, y.entry.row, y.entry.source);
  });
  // What is gone stood with the unknown that was the lower one: where that has moved, all of its front is looked for.
  if (kept->removed.empty()) return;
  const std::vector<Index>& order = kept->before.tree.order;
  std::vector<Index> place(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) place[at(order[k])] = static_cast<Index>(k);
  const auto place_before = [&](Index position) { return place[at(plan.tree.order[at(position)])]; };
  for (const auto& [row, col] : kept->removed) {
    if (both && row < col) continue;
    const Index r = row_position[at(row)], c = column_position[at(col)];
    lost_from_.push_back(front_of(place_before(r) < place_before(c) ? r : c));
  }
  std::sort(lost_from_.begin(), lost_from_.end());
}

std::span<const ChangedEntries::Added> ChangedEntries::added_to(Index f) const {
  const auto begin =
      std::lower_bound(added_.begin(), added_.end(), f, [](const Added& a, Index g) { return a.front < g; });
  auto end = begin;
  while (end != added_.end() && end->front == f) ++end;
  return {begin, end};
}

Offset ChangedEntries::count(Index f) const {
  const Plan& was = kept_->before;
  const Index old = front_before(f);
  const auto [first, last] = std::equal_range(lost_from_.begin(), lost_from_.end(), f);
  return was.entry_ptr[at(was.first_tile[at(old + 1)])] - was.entry_ptr[at(was.first_tile[at(old)])] +
         static_cast<Offset>(added_to(f).size()) - (last - first);
}

void ChangedEntries::collect(Index f, std::vector<PermutedEntry>& list, std::vector<std::size_t>& ptr) const {
  const Plan& was = kept_->before;
  const Index old = front_before(f);
  const FrontLayout& l = was.layout[at(old)];
  std::vector<Index> position(at(l.rows));  // of now, by rows of the front
  std::iota(position.begin(), position.begin() + l.pivots, plan_.tree.first[at(f)]);
  for (Index k = 0; k < l.below(); ++k)
    position[at(l.pivots + k)] = column_position_[at(was.tree.order[at(was.rows_below(old)[k])])];
  ptr.assign(at(l.pivots) + 1, 0);
  visit_entries(was, old, [&](Index, Index col, const EntryPlace&) { ++ptr[at(col) + 1]; });
  std::partial_sum(ptr.begin(), ptr.end(), ptr.begin());
  list.resize(ptr.back());
  std::vector<std::size_t> next(ptr.begin(), ptr.end() - 1);
  SourceMap::Cursor now(kept_->now);
  visit_entries(was, old, [&](Index row, Index col, const EntryPlace& e) {
    list[next[at(col)]++] = {now(e.source()), position[at(row)], e.transposed()};
  });
  merge(f, list, ptr);
}

// Leaves out what is gone, adds what came, and brings rows of each column into order.
void ChangedEntries::merge(Index f, std::vector<PermutedEntry>& list, std::vector<std::size_t>& ptr) const {
  const auto rises = [](const PermutedEntry& x, const PermutedEntry& y) {
    return x.row != y.row ? x.row < y.row : x.source < y.source;
  };
  const std::span<const Added> added = added_to(f);
  const bool others = !added.empty() || std::binary_search(lost_from_.begin(), lost_from_.end(), f);
  std::vector<PermutedEntry> merged;
  auto next = added.begin();
  std::size_t begin = 0;
  for (std::size_t col = 0; col + 1 < ptr.size(); ++col) {
    auto first = list.begin() + static_cast<std::ptrdiff_t>(begin);
    auto last = list.begin() + static_cast<std::ptrdiff_t>(ptr[col + 1]);
    begin = ptr[col + 1];
    if (others) {
      const auto start = static_cast<std::ptrdiff_t>(merged.size());
      std::copy_if(first, last, std::back_inserter(merged), [](const PermutedEntry& e) { return e.source >= 0; });
      for (; next != added.end() && at(next->column) == col; ++next) merged.push_back(next->entry);
      first = merged.begin() + start;
      last = merged.end();
      ptr[col + 1] = merged.size();
    }
    if (!std::is_sorted(first, last, rises)) std::sort(first, last, rises);
  }
  if (others) list = std::move(merged);
}

}  // namespace espalier::plan
