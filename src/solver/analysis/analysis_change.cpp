// A pattern that has changed here and there: what the change does not touch of the analysis is kept.
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "analysis/tree_change.hpp"
#include "base/at.hpp"
#include "matrix/norms.hpp"
#include "plan/front_cost.hpp"
#include "plan/kept_entries.hpp"
#include "plan/kept_places.hpp"
#include "solver/analysis/analysis_draft.hpp"
#include "solver/analysis/fresh_order.hpp"
#include "solver/analysis/pattern_difference.hpp"
#include "solver/ranks/whole_plan.hpp"

namespace espalier::solver {

namespace {

// Beyond these, a new order is worth its time.
constexpr double kMostChanged = 0.1;  // of all entries, added or removed
constexpr double kMostFill = 1.05;    // over that of the last order
constexpr double kMostFlops = 1.15;

using Edge = analysis::PatternChange::Edge;

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

analysis::ChangedTree follow_tree(const analysis::AssemblyTree& before, const System& system,
                                  const PatternDifference& difference, base::ThreadPool& pool) {
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
std::string reason_against(const PreparedMatrix& was, const PatternDifference& difference) {
  const auto changed = static_cast<double>(difference.added.size() + difference.removed.size());
  if (changed > kMostChanged * static_cast<double>(was.a.nonzeros()))
    return fmt::format("{:.0f} % of the entries have come or gone",
                       100 * changed / static_cast<double>(std::max<Offset>(1, was.a.nonzeros())));
  if (!keeps_matching(was, difference.removed)) return "entries are gone that rows or pivots were matched by";
  return {};
}

std::string reason_against(const Analysis& made) {
  const double fill =
      static_cast<double>(made.plan.nonzeros_factor) / static_cast<double>(std::max<Offset>(1, made.fill_of_ordering));
  const double flops = made.plan.flops / std::max(1.0, made.flops_of_ordering);
  if (fill <= kMostFill && flops <= kMostFlops) return {};
  return fmt::format("the factor would have {:.3f} times the entries and the work {:.3f} times that of the last order",
                     fill, flops);
}

// Rows (columns) of which nothing is left.
void refuse_empty_rows(const MatrixView& a, const matrix::RowIndex& rows, const PatternDifference& difference) {
  const auto row_has_entries = [&](Index r) {
    if (!rows.ptr.empty() && rows.ptr[at(r) + 1] > rows.ptr[at(r)]) return true;
    return a.storage != Storage::general && a.col_ptr[at(r) + 1] > a.col_ptr[at(r)];
  };
  std::vector<Index> empty, columns;
  for (const auto& [row, col] : difference.removed) {
    if (!row_has_entries(row)) empty.push_back(row);
    if (a.storage == Storage::general && a.col_ptr[at(col) + 1] == a.col_ptr[at(col)]) columns.push_back(col);
    if (a.storage != Storage::general && !row_has_entries(col)) empty.push_back(col);
  }
  const auto refuse = [](std::vector<Index> list, const std::string& what) {
    if (list.empty()) return;
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    throw Error(
        StatusCode::singular,
        fmt::format("the changed matrix is structurally singular: no entry is left in {}{}; give it entries, or "
                    "leave it out",
                    what, name_rows(list)),
        list.front());
  };
  refuse(std::move(empty), "");
  refuse(std::move(columns), "what is now an empty column, as ");
}

Offset entries_of(const analysis::AssemblyTree& tree) {
  Offset entries = 0;
  for (Index f = 0; f < tree.fronts(); ++f) {
    const Offset k = tree.pivots(f);
    entries += k * (k + tree.rows_below(f)) - k * (k - 1) / 2;
  }
  return entries;
}

double flops_of(const analysis::AssemblyTree& tree) {
  double flops = 0;
  for (Index f = 0; f < tree.fronts(); ++f)
    flops += plan::front_flops(tree.pivots(f), tree.pivots(f) + tree.rows_below(f), false);
  return flops;
}

// Seconds of the parts of the work, for the log.
class Laps {
 public:
  void add(const char* part) {
    const double now = base::now_seconds();
    text_ += fmt::format("{}{} {:.4f} s", text_.empty() ? "" : ", ", part, now - last_);
    last_ = now;
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  double last_ = base::now_seconds();
  std::string text_;
};

// How an analysis goes on.
struct NextTree {
  analysis::ChangedTree followed;
  bool reordered = false;
  double fill = 0, flops = 0;  // of an order for this pattern, over those of the tree; 0: none was made
};

// What the fresh order comes to is known either way: the promises count from it.
NextTree next_tree(const Analysis& before, const System& system, const PatternDifference& difference, FreshOrder* fresh,
                   const Context& context) {
  constexpr double kWorthIt = 1.005;
  const bool part = !before.plan.row_begin.empty() && !before.system->real_form;
  const analysis::AssemblyTree parts = part ? whole_tree(before.plan, context.link) : analysis::AssemblyTree();
  NextTree next{follow_tree(part ? parts : before.own_tree(), system, difference, context.pool), false, 0, 0};
  const auto changed = static_cast<Offset>(difference.added.size() + difference.removed.size());
  if (fresh == nullptr || !fresh->is_due(changed) || !fresh->fits(before)) return next;
  const std::optional<analysis::AssemblyTree> ordered = fresh->take(context.pool);
  if (!ordered) {
    context.log("the order beside the work could not be made: there was no memory for it");
    return next;
  }
  const PatternDifference since = compare_patterns(fresh->system().prepared.a, system.prepared.a, context.pool);
  analysis::ChangedTree other = follow_tree(*ordered, system, since, context.pool);
  const analysis::AssemblyTree& mine = next.followed.tree;
  next.fill = static_cast<double>(entries_of(other.tree)) / static_cast<double>(entries_of(mine));
  next.flops = flops_of(other.tree) / flops_of(mine);
  context.log(fmt::format("the order that was made beside the work: {:.4f} times the entries, {:.4f} times the work",
                          next.fill, next.flops));
  if (next.fill * kWorthIt >= 1 && next.flops * kWorthIt >= 1) return next;
  next.reordered = true;
  next.fill = next.flops = 1;
  other.kept = 0;
  next.followed = std::move(other);
  return next;
}

// What fronts that stay leave to a factor of `made`. Room is left between them, which a budget may not have.
FollowedAnalysis::Numbers numbers_that_stay(Analysis& made, const Analysis& before, const std::vector<Index>& same,
                                            const Context& context) {
  FollowedAnalysis::Numbers n{plan::fronts_that_stay(made.plan, before.plan, same), {}, {}};
  const auto some_stay = [&] {
    return std::any_of(n.fronts.same.begin(), n.fronts.same.end(), [](Index f) { return f >= 0; });
  };
  if (!made.plan.options.keep_contributions || made.device.devices() > 1)
    n.why_none = "several devices, and those without room for it, keep no numbers of a pattern before";
  else if (!some_stay())
    n.why_none = "the changed factor has no room beside that of the pattern before";
  if (!n.why_none.empty()) return n;
  const Offset limit = made.device.backend->limits().own_memory ? 0 : context.budget.limit();
  if (limit <= 0 || predicted_host_bytes(made, context) <= limit) return n;
  plan::plan_memory(made.plan);
  n.why_none = "the budget has no room for what is new beside the numbers of the pattern before";
  return n;
}

// Whether a matrix that was symmetric, or Hermitian, is that still.
bool stays_symmetric(const GivenMatrix& given, base::Numbers before) {
  const MatrixView& a = given.a;
  if (a.symmetric()) return given.numbers == before;
  if (a.values.empty()) return matrix::structure_is_symmetric(a);
  if (before == base::Numbers::real) return matrix::values_are_symmetric(a);
  return matrix::values_are_symmetric(a, complex_view(given).values, before == base::Numbers::hermitian);
}

// Gives a system the real form that the analysis before has.
analysis::AssemblyTree take_real_form(System& system, analysis::AssemblyTree tree, base::ThreadPool& pool) {
  analysis::AssemblyTree two = doubled(tree);
  system.real_form = make_real_form(system.prepared, std::move(tree), pool);
  return two;
}

}  // namespace

FollowedAnalysis follow_pattern(const Analysis& before, const GivenMatrix& given, const Context& context,
                                FreshOrder* fresh, bool numbers) {
  const double start = base::now_seconds();
  Laps laps;
  check_matrix(given, context.pool);
  laps.add("check");
  FollowedAnalysis followed;
  followed.why = reason_against(before, given.a, context);
  if (!followed.why.empty()) return followed;
  GivenMatrix a = given;
  if (!context.options.analyze_values) a.a.values = {};
  const PreparedMatrix& was = before.system->prepared;
  const bool may_be_another = context.options.kind == Kind::automatic || was.numbers != base::Numbers::real;
  if (may_be_another && before.kind() != Kind::lu && !stays_symmetric(a, was.numbers)) {
    followed.why = was.numbers == base::Numbers::hermitian ? "the matrix is not Hermitian any more"
                                                           : "the matrix is not symmetric any more";
    return followed;
  }
  if (before.kind() != Kind::lu) a.numbers = was.numbers;
  if (a.numbers == base::Numbers::real)
    (void)choose_kind(a.a, before.kind(), context.pool);  // llt and ldlt need a symmetric matrix
  auto system = std::make_shared<System>();
  system->kind = before.kind();
  system->kind_may_change = before.system->kind_may_change;
  PreparedMatrix& p = system->prepared = prepare_matrix(a, before.kind(), context.pool);
  laps.add("copy");
  PatternDifference difference = compare_patterns(was.a, p.a, context.pool);
  laps.add("comparison");
  followed.added = static_cast<Offset>(difference.added.size());
  followed.removed = static_cast<Offset>(difference.removed.size());
  system->rows = follow_rows(*before.system->index_of_all(context.pool), was.a, p.a, difference, context.pool);
  laps.add("rows");
  if (context.options.singular == SingularMatrix::error) refuse_empty_rows(p.a, *system->rows, difference);
  followed.why = reason_against(was, difference);
  if (!followed.why.empty()) return followed;
  take_over(was, p);
  NextTree next = next_tree(before, *system, difference, fresh, context);
  analysis::ChangedTree& tree = next.followed;
  followed.reordered = next.reordered;
  followed.moved = tree.moved;
  followed.kept = tree.kept;
  laps.add("tree");
  const double ordered = base::now_seconds();
  Values values = std::exchange(p.a.values, {});
  const plan::KeptEntries kept{before.plan,      tree.same,          difference.now, tree.with_pivots,
                               difference.added, difference.removed, numbers};
  // A rank's next part has other fronts, and pivots of a real form may have moved.
  const bool of_real_form = before.system->real_form != nullptr;
  const bool keeps = before.plan.row_begin.empty() && !next.reordered && !of_real_form;
  if (of_real_form) tree.tree = take_real_form(*system, std::move(tree.tree), context.pool);
  const std::shared_ptr<const matrix::RowIndex> rows = share_rows(*system, before.device, context);
  Context as_before = context;
  as_before.raised = before.fp64;
  auto made = std::make_shared<Analysis>(
      lay_out(std::move(system), std::move(tree.tree),
              {before.device, next.reordered || of_real_form ? 0 : before.moved_pivots, before.free_pivots}, as_before,
              rows.get(), keeps ? &kept : nullptr));
  laps.add("plan");
  context.log("the changed pattern was followed: " + laps.text());
  made->gain_of_single = before.gain_of_single;
  made->fill_of_ordering = before.fill_of_ordering;
  made->flops_of_ordering = before.flops_of_ordering;
  made->changed_since_ordering = before.changed_since_ordering + followed.added + followed.removed;
  if (next.fill > 0) {
    made->fill_of_ordering = static_cast<Offset>(next.fill * static_cast<double>(made->plan.nonzeros_factor));
    made->flops_of_ordering = next.flops * made->plan.flops;
    made->changed_since_ordering = 0;
  }
  followed.why = reason_against(*made);
  if (!followed.why.empty()) return followed;
  if (next.reordered)
    followed.numbers.why_none = "an order from beside the work has taken the place of the one before";
  else if (of_real_form)
    followed.numbers.why_none =
        "of a complex system that is factorized as a real one all is made once where the pattern has changed";
  else if (numbers)
    followed.numbers = numbers_that_stay(*made, before, tree.same, as_before);
  followed.numbers.entries = std::move(difference.now);
  made->result.ordering_seconds = ordered - start;
  made->result.plan_seconds = base::now_seconds() - ordered;
  describe(*made, as_before);
  made->result.seconds = base::now_seconds() - start;
  followed.made = {std::move(made), std::move(values)};
  return followed;
}

}  // namespace espalier::solver
