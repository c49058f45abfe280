// Plans of a thousand changed patterns. Truth: indices and plans that know of no pattern before, made by one thread.
#include <gtest/gtest.h>

#include <utility>

#include "analysis/ordering.hpp"
#include "analysis/tree_change.hpp"
#include "plan/kept_entries.hpp"
#include "plan/plan.hpp"
#include "solve/residual.hpp"
#include "solver/analysis/pattern_difference.hpp"
#include "solver/analysis/prepared_matrix.hpp"
#include "solver/solver_common.hpp"
#include "verdict/changes.hpp"

namespace espalier::test {

namespace followed_plan_test {

void expect_equal(const matrix::RowIndex& mine, const matrix::RowIndex& theirs) {
  EXPECT_EQ(mine.ptr, theirs.ptr);
  ASSERT_EQ(mine.col.size(), theirs.col.size());
  for (Offset q = 0; q < mine.col.size(); ++q) {
    ASSERT_EQ(mine.col[q], theirs.col[q]) << q;
    ASSERT_EQ(mine.source[q], theirs.source[q]) << q;
  }
}

bool operator==(const plan::EntryPlace& x, const plan::EntryPlace& y) {
  return x.source() == y.source() && x.row() == y.row() && x.col() == y.col() && x.transposed() == y.transposed();
}
bool operator==(const plan::Task& x, const plan::Task& y) {
  return x.front == y.front && x.begin == y.begin && x.i == y.i && x.j == y.j;
}
bool operator==(const plan::FrontLayout& x, const plan::FrontLayout& y) {
  return x.pivots == y.pivots && x.rows == y.rows && x.pivot_width == y.pivot_width && x.below_width == y.below_width &&
         x.pivot_tiles == y.pivot_tiles && x.tiles == y.tiles && x.panel == y.panel;
}

// All fields but those of plan.tree, which both were given, and plan.options.
void expect_equal(const plan::Plan& mine, const plan::Plan& theirs) {
  const auto same = [](const char* name, const auto& x, const auto& y) {
    EXPECT_EQ(x.size(), y.size()) << name;
    if (x.size() != y.size()) return;
    for (std::size_t k = 0; k < x.size(); ++k) ASSERT_TRUE(x[k] == y[k]) << name << ", place " << k;
  };
  same("layout", mine.layout, theirs.layout);
  same("whole", mine.whole, theirs.whole);
  same("child_ptr", mine.child_ptr, theirs.child_ptr);
  same("children", mine.children, theirs.children);
  same("relative", mine.relative, theirs.relative);
  same("first_tile", mine.first_tile, theirs.first_tile);
  same("entry_ptr", mine.entry_ptr, theirs.entry_ptr);
  same("entries", mine.entries, theirs.entries);
  same("tasks", mine.tasks, theirs.tasks);
  same("first_task", mine.first_task, theirs.first_task);
  same("last_task", mine.last_task, theirs.last_task);
  same("tier", mine.tier, theirs.tier);
  EXPECT_EQ(mine.nonzeros_factor, theirs.nonzeros_factor);
  EXPECT_EQ(mine.flops, theirs.flops);
  const plan::MemoryPlan &m = mine.memory, &t = theirs.memory;
  EXPECT_EQ(m.size, t.size);
  EXPECT_EQ(m.added, t.added);
  EXPECT_EQ(m.factor_size, t.factor_size);
  EXPECT_EQ(m.stack_size, t.stack_size);
  same("factor", m.factor, t.factor);
  same("factor2", m.factor2, t.factor2);
  same("contribution", m.contribution, t.contribution);
  same("contribution2", m.contribution2, t.contribution2);
  same("on_stack", m.on_stack, t.on_stack);
  same("wait_ptr", m.wait_ptr, t.wait_ptr);
  same("wait_fronts", m.wait_fronts, t.wait_fronts);
  same("device_size", m.device_size, t.device_size);
}

TEST(FollowedPlan, IsThatOfNoPatternBefore) {
  base::ThreadPool pool(2), alone(1);
  for (std::uint64_t seed = 1; seed <= 250; ++seed) {
    verdict::ChangingSystem system(static_cast<int>(seed % 7), static_cast<Index>(30 + 5 * (seed % 40)), seed);
    const bool general = system.matrix().storage == Storage::general;
    const Storage storages[] = {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both};
    const Storage storage = general ? Storage::general : storages[seed % 3];
    SCOPED_TRACE(testing::Message() << system.name() << ", seed " << seed);
    plan::PlanOptions options;
    options.unsymmetric = general;
    options.ldlt = !general && seed % 3 == 0;
    options.keep_contributions = seed % 11 == 0;
    options.narrow_first = seed % 5 == 0;
    options.tiles.narrow_rows = seed % 5 == 0 ? 40 : 0;
    options.tiles.narrow_width = seed % 5 == 0 ? 8 : 0;
    if (seed % 2 == 0) options.tiles.whole_rows = options.tiles.max_block_size = 16;
    const auto prepared = [&] {  // each entry once
      return solver::prepare_matrix(MatrixView(reference::stored_as(system.matrix(), storage)),
                                    general ? Kind::lu : Kind::llt, pool)
          .a;
    };
    solver::StoredMatrix a = prepared();
    auto rows = solve::ResidualOperator::rows_of(a, pool);
    plan::Plan plan =
        plan::make_plan(analysis::build_tree(analysis::graph_of(a, pool), {}, pool), a, {}, options, pool);
    for (int k = 0; k < 4; ++k) {
      system.change();
      solver::StoredMatrix b = prepared();
      const MatrixView view = b;
      const solver::PatternDifference d = solver::compare_patterns(a, view, pool);
      rows = solver::follow_rows(*rows, a, view, d, pool);
      expect_equal(*rows, *solve::ResidualOperator::rows_of(view, pool));
      analysis::PatternChange change{{}, {}, {}, view, *rows};
      for (auto [from, to] : {std::pair{&d.added, &change.added}, std::pair{&d.removed, &change.removed}})
        for (const auto& [r, c] : *from) {
          if (r == c)
            change.diagonal.push_back(c);
          else
            to->emplace_back(r, c);
        }
      const analysis::ChangedTree t = analysis::change_tree(plan.tree, change, pool);
      const plan::KeptEntries kept{plan, t.same, d.now, t.with_pivots, d.added, d.removed};
      plan::Plan followed = plan::make_plan(t.tree, view, {}, options, pool, rows.get(), &kept);
      expect_equal(followed, plan::make_plan(t.tree, view, {}, options, alone));
      if (HasFatalFailure()) return;
      plan = std::move(followed);
      a = std::move(b);
    }
  }
}

}  // namespace followed_plan_test

}  // namespace espalier::test
