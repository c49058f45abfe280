// A pattern that has changed here and there: what the change does not touch of the analysis is kept.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "analysis/tree_change.hpp"
#include "base/at.hpp"
#include "plan/kept_entries.hpp"
#include "solver/analysis_draft.hpp"
#include "solver/whole_plan.hpp"

namespace espalier::solver {

namespace {

// Beyond these, a new order is worth its time.
constexpr double kMostChanged = 0.1;  // of all entries, added or removed
constexpr double kMostFill = 1.05;    // over that of the last full analysis
constexpr double kMostFlops = 1.15;

using Edge = analysis::PatternChange::Edge;

// Entries (row, column) that only one of two columns has.
void compare_column(std::span<const Index> before, std::span<const Index> now, Index col, std::vector<Edge>& removed,
                    std::vector<Edge>& added) {
  std::vector<Index> x(before.begin(), before.end()), y(now.begin(), now.end()), only;
  std::sort(x.begin(), x.end());
  std::sort(y.begin(), y.end());
  std::set_difference(x.begin(), x.end(), y.begin(), y.end(), std::back_inserter(only));
  for (const Index r : only) removed.emplace_back(r, col);
  only.clear();
  std::set_difference(y.begin(), y.end(), x.begin(), x.end(), std::back_inserter(only));
  for (const Index r : only) added.emplace_back(r, col);
}

struct Difference {
  std::vector<Edge> added, removed;  // (row, column)
  std::vector<Index> columns;        // in which entries came, went, or stand in another order
};

std::span<const Index> column_of(const MatrixView& a, Index c) {
  return a.row_ind.subspan(static_cast<std::size_t>(a.col_ptr[at(c)]),
                           static_cast<std::size_t>(a.col_ptr[at(c) + 1] - a.col_ptr[at(c)]));
}

Difference compare(const MatrixView& before, const MatrixView& now, base::ThreadPool& pool) {
  constexpr std::int64_t kColumns = 4096;  // per range
  std::vector<Difference> parts(static_cast<std::size_t>((now.cols + kColumns - 1) / kColumns));
  pool.for_each_range(now.cols, kColumns, [&](std::int64_t begin, std::int64_t end) {
    Difference& mine = parts[static_cast<std::size_t>(begin / kColumns)];
    for (auto c = static_cast<Index>(begin); c < end; ++c) {
      const auto x = column_of(before, c), y = column_of(now, c);
      if (std::equal(x.begin(), x.end(), y.begin(), y.end())) continue;
      mine.columns.push_back(c);
      compare_column(x, y, c, mine.removed, mine.added);
    }
  });
  Difference all;
  for (const Difference& d : parts) {
    all.added.insert(all.added.end(), d.added.begin(), d.added.end());
    all.removed.insert(all.removed.end(), d.removed.begin(), d.removed.end());
    all.columns.insert(all.columns.end(), d.columns.begin(), d.columns.end());
  }
  return all;
}

// Of entries that are gone: -1.
plan::SourceMap sources(const MatrixView& before, const MatrixView& now, const std::vector<Index>& changed) {
  plan::SourceMap map;
  map.move(0, 0);
  std::vector<std::pair<Index, Offset>> place;  // row, entry
  std::vector<Offset> found;
  for (const Index c : changed) {
    place.clear();
    found.clear();
    for (Offset q = now.col_ptr[at(c)]; q < now.col_ptr[at(c) + 1]; ++q)
      place.emplace_back(now.row_ind[static_cast<std::size_t>(q)], q);
    std::sort(place.begin(), place.end());
    for (const Index r : column_of(before, c)) {
      const auto here = std::lower_bound(place.begin(), place.end(), std::pair<Index, Offset>{r, 0});
      found.push_back(here != place.end() && here->first == r ? here->second : -1);
    }
    map.list(before.col_ptr[at(c)], found);
    map.move(before.col_ptr[at(c) + 1], now.col_ptr[at(c) + 1] - before.col_ptr[at(c) + 1]);
  }
  map.close(before.nonzeros());
  return map;
}

// Entries of the matrix as edges between columns (a row is its column by the matching), and those of the diagonal.
std::vector<Edge> edges_of(const std::vector<Edge>& entries, const std::vector<Index>& column_of_row,
                           std::vector<Index>& diagonal) {
  std::vector<Edge> edges;
  for (const auto& [row, col] : entries) {
    const Index u = column_of_row.empty() ? row : column_of_row[at(row)];
    if (u == col)
      diagonal.push_back(col);
    else
      edges.emplace_back(u, col);
  }
  return edges;
}

// The matching must not lose entries.
bool keeps_matching(const PreparedMatrix& p, const std::vector<Edge>& removed) {
  return std::none_of(removed.begin(), removed.end(), [&](const Edge& e) {
    const auto& [row, col] = e;
    if (!p.row_of_col.empty() && p.row_of_col[at(col)] == row) return true;
    return !p.pair.empty() && (p.pair[at(col)] == row || p.pair[at(row)] == col);
  });
}

// Scaling, matching and what follows from them stay.
void take_over(const PreparedMatrix& from, PreparedMatrix& to) {
  to.row_scale = from.row_scale;
  to.col_scale = from.col_scale;
  to.row_of_col = from.row_of_col;
  to.pair = from.pair;
  to.zero_diagonal = from.zero_diagonal;
  to.transform_sign = from.transform_sign;
  to.transform_log = from.transform_log;
  to.wide = from.wide;
  to.unmatched = from.unmatched;
}

std::string reason_against(const Analysis& before, const MatrixView& a, const Context& context) {
  const PreparedMatrix& p = before.system->prepared;
  if (before.system->border) return "a Schur complement is part of the analysis";
  if (!context.options.permutation.empty()) return "the order is the caller's";
  if (a.cols != p.n()) return fmt::format("there were {} unknowns, now there are {}", p.n(), a.cols);
  const Storage stored = p.symmetric_values ? Storage::general : p.a.storage;
  if (p.source.empty() && a.storage != stored) return "the storage is another one";
  return {};
}

}  // namespace

namespace {

// Entries of the row index that have come: row, column, place.
struct NewEntry {
  Index row, col;
  Offset source;
};

std::vector<NewEntry> new_of_index(const MatrixView& a, const std::vector<Edge>& added) {
  std::vector<NewEntry> list;
  for (const auto& [row, col] : added) {
    if (a.storage != Storage::general && row == col) continue;
    const auto column = column_of(a, col);
    const auto place = std::find(column.begin(), column.end(), row) - column.begin();
    list.push_back({row, col, a.col_ptr[at(col)] + place});
  }
  std::sort(list.begin(), list.end(),
            [](const NewEntry& x, const NewEntry& y) { return x.row != y.row ? x.row < y.row : x.col < y.col; });
  return list;
}

// The index of `a` from that of the pattern before: sources have moved, some entries have gone, others come in between.
std::shared_ptr<const matrix::RowIndex> follow_rows(const matrix::RowIndex& was, const MatrixView& a,
                                                    const Difference& difference, const plan::SourceMap& now,
                                                    base::ThreadPool& pool) {
  constexpr std::int64_t kRows = 4096;  // per range
  auto made = std::make_shared<matrix::RowIndex>();
  if (was.ptr.empty()) return made;
  const std::vector<NewEntry> added = new_of_index(a, difference.added);
  made->ptr.assign(was.ptr.size(), 0);
  for (std::size_t r = 0; r + 1 < was.ptr.size(); ++r) made->ptr[r + 1] = was.ptr[r + 1] - was.ptr[r];
  for (const NewEntry& e : added) ++made->ptr[at(e.row) + 1];
  for (const auto& [row, col] : difference.removed)
    if (a.storage == Storage::general || row != col) --made->ptr[at(row) + 1];
  for (std::size_t r = 0; r + 1 < made->ptr.size(); ++r) made->ptr[r + 1] += made->ptr[r];
  made->col = base::Buffer<Index>(made->ptr.back(), nullptr);
  made->source = base::Buffer<Offset>(made->ptr.back(), nullptr);
  pool.for_each_range(a.rows, kRows, [&](std::int64_t begin, std::int64_t end) {
    auto next = std::lower_bound(added.begin(), added.end(), begin,
                                 [](const NewEntry& e, std::int64_t row) { return e.row < row; });
    for (auto r = static_cast<std::size_t>(begin); r < static_cast<std::size_t>(end); ++r) {
      Offset to = made->ptr[r];
      const auto put = [&](Index col, Offset source) {
        made->col[to] = col;
        made->source[to++] = source;
      };
      const auto put_new = [&](Index before) {
        for (; next != added.end() && at(next->row) == r && next->col < before; ++next) put(next->col, next->source);
      };
      for (Offset q = was.ptr[r]; q < was.ptr[r + 1]; ++q) {
        put_new(was.col[q]);
        if (const Offset source = now(was.source[q]); source >= 0) put(was.col[q], source);
      }
      put_new(a.cols);
    }
  });
  return made;
}

analysis::ChangedTree follow_tree(const analysis::AssemblyTree& before, const System& system,
                                  const Difference& difference, base::ThreadPool& pool) {
  const PreparedMatrix& p = system.prepared;
  std::vector<Index> column_of_row(p.row_of_col.size()), diagonal;
  for (std::size_t c = 0; c < p.row_of_col.size(); ++c) column_of_row[at(p.row_of_col[c])] = static_cast<Index>(c);
  std::vector<Edge> added = edges_of(difference.added, column_of_row, diagonal);
  std::vector<Edge> removed = edges_of(difference.removed, column_of_row, diagonal);
  const MatrixView a = p.a;
  return analysis::change_tree(
      before, {std::move(added), std::move(removed), std::move(diagonal), a, *system.rows, p.row_of_col}, pool);
}

// Why the entries that came and went are too many, or the wrong ones; empty: they are not.
std::string reason_against(const PreparedMatrix& was, const Difference& difference) {
  const auto changed = static_cast<double>(difference.added.size() + difference.removed.size());
  if (changed > kMostChanged * static_cast<double>(was.a.nonzeros()))
    return fmt::format("{:.0f} % of the entries have come or gone",
                       100 * changed / static_cast<double>(std::max<Offset>(1, was.a.nonzeros())));
  if (!keeps_matching(was, difference.removed)) return "entries are gone that rows or pivots were matched by";
  return {};
}

std::string reason_against(const Analysis& before, const plan::Plan& plan) {
  const double fill =
      static_cast<double>(plan.nonzeros_factor) / static_cast<double>(std::max<Offset>(1, before.fill_of_ordering));
  const double flops = plan.flops / std::max(1.0, before.flops_of_ordering);
  if (fill <= kMostFill && flops <= kMostFlops) return {};
  return fmt::format(
      "the factor would have {:.3f} times the entries and the work {:.3f} times that of the last full "
      "analysis",
      fill, flops);
}

}  // namespace

FollowedAnalysis follow_pattern(const Analysis& before, const MatrixView& given, const Context& context) {
  const double start = base::now_seconds();
  check_matrix(given, context.pool);
  FollowedAnalysis followed;
  followed.why = reason_against(before, given, context);
  if (!followed.why.empty()) return followed;
  MatrixView a = given;
  if (!context.options.analyze_values) a.values = {};
  const PreparedMatrix& was = before.system->prepared;
  (void)choose_kind(a, before.kind(), context.pool);  // llt and ldlt need a symmetric matrix
  auto system = std::make_shared<System>();
  system->kind = before.kind();
  system->kind_may_change = before.system->kind_may_change;
  PreparedMatrix& p = system->prepared = prepare_matrix(a, before.kind(), context.pool);
  const Difference difference = compare(was.a, p.a, context.pool);
  followed.added = static_cast<Offset>(difference.added.size());
  followed.removed = static_cast<Offset>(difference.removed.size());
  followed.why = reason_against(was, difference);
  if (!followed.why.empty()) return followed;
  take_over(was, p);
  const plan::SourceMap now = sources(was.a, p.a, difference.columns);
  system->rows = follow_rows(*before.system->index_of_all(context.pool), p.a, difference, now, context.pool);
  analysis::ChangedTree tree = follow_tree(whole_tree(before.plan, context.link), *system, difference, context.pool);
  followed.moved = tree.moved;
  followed.kept = tree.kept;
  const double ordered = base::now_seconds();
  Values values = std::exchange(p.a.values, {});
  const plan::KeptEntries kept{before.plan, tree.same, now};
  const bool whole = before.plan.row_begin.empty();  // a rank's next part has other fronts
  const std::shared_ptr<const matrix::RowIndex> rows = share_rows(*system, before.device, context);
  Context as_before = context;
  as_before.raised = before.fp64;
  auto made = std::make_shared<Analysis>(lay_out(std::move(system), std::move(tree.tree),
                                                 {before.device, before.moved_pivots, before.free_pivots}, as_before,
                                                 rows.get(), whole ? &kept : nullptr));
  followed.why = reason_against(before, made->plan);
  if (!followed.why.empty()) return followed;
  made->gain_of_single = before.gain_of_single;
  made->fill_of_ordering = before.fill_of_ordering;
  made->flops_of_ordering = before.flops_of_ordering;
  made->result.ordering_seconds = ordered - start;
  made->result.plan_seconds = base::now_seconds() - ordered;
  describe(*made, as_before);
  made->result.seconds = base::now_seconds() - start;
  followed.made = {std::move(made), std::move(values)};
  return followed;
}

}  // namespace espalier::solver
