// Plans that follow moved pivots. The truth is what every plan has to keep (plan_checks.hpp), and the plan before: what
// is called the same has the same columns and rows, and its factor in the same place.
#include "plan/changed_plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "analysis/relocation.hpp"
#include "plan/plan_checks.hpp"

namespace espalier::plan {
namespace {

using namespace testing;

// Some pivots go to ancestors of their fronts, some of a root to its end.
std::vector<analysis::PivotMove> random_moves(const AssemblyTree& t, std::mt19937& random) {
  std::vector<analysis::PivotMove> moves;
  const Index one_in = 4 << random() % 6;
  for (Index f = 0; f < t.fronts(); ++f) {
    const bool all = random() % 40 == 0;  // then the front vanishes
    for (Index p = t.first[f]; p < t.first[f + 1]; ++p) {
      if (!all && random() % static_cast<unsigned>(one_in) != 0) continue;
      Index to = f;
      for (unsigned up = 1 + random() % 3; up > 0 && t.parent[to] >= 0; --up) to = t.parent[to];
      moves.push_back({p, to});
    }
  }
  return moves;
}

PlanOptions random_options(std::mt19937& random) {
  PlanOptions o = random_tiles(random);
  o.group_entries = pick(random, {0, 100, 5000});
  o.interleave = pick(random, {1, 2, 4});
  o.reuse_distance = pick(random, {0, 1, 8});
  return o;
}

Index same_fronts(const Plan& before, const ChangedPlan& changed) {
  Index same = 0;
  const AssemblyTree &t = changed.plan.tree, &was = before.tree;
  for (Index f = 0; f < t.fronts(); ++f) {
    const Index o = changed.before.same[f];
    if (o < 0) continue;
    ++same;
    EXPECT_EQ(changed.before.front[f], o);
    EXPECT_EQ(changed.plan.memory.factor[f], before.memory.factor[o]);
    EXPECT_EQ(changed.plan.memory.contribution[f], before.memory.contribution[o]);
    EXPECT_EQ(t.pivots(f), was.pivots(o));
    EXPECT_EQ(t.rows_below(f), was.rows_below(o));
    for (Index k = 0; k < t.pivots(f); ++k) EXPECT_EQ(t.order[t.first[f] + k], was.order[was.first[o] + k]);
    for (Index r = 0; r < t.rows_below(f); ++r)
      EXPECT_EQ(t.order[t.rows[t.row_ptr[f] + r]], was.order[was.rows[was.row_ptr[o] + r]]);
  }
  return same;
}

// What fits in its place stays there. @returns fronts whose contribution did
Index fitting_contributions(const Plan& before, const ChangedPlan& changed) {
  Index stayed = 0;
  Offset grown = 0;  // elements of factors that have new places
  const Plan& now = changed.plan;
  std::vector<char> named(before.layout.size(), 0);
  for (const Index o : changed.before.front) named[o] = 1;
  for (Index f = 0; f < now.fronts(); ++f) {
    const Index o = changed.before.front[f], up = before.tree.parent[o];
    const Offset left = now.layout[f].contribution_size(), factor = now.layout[f].factor_size();
    if (factor > before.layout[o].factor_size()) grown += factor * (now.options.unsymmetric ? 2 : 1);
    if (before.memory.on_stack[o] != 0 || up < 0 || named[up] == 0 || now.tree.parent[f] < 0 || left == 0) continue;
    if (left > before.layout[o].contribution_size()) continue;
    EXPECT_EQ(now.memory.contribution[f], before.memory.contribution[o]);
    ++stayed;
  }
  EXPECT_GE(now.memory.factor_size, before.memory.factor_size + grown);
  return stayed;
}

TEST(ChangedPlan, KeepsThePromisesOfAPlanAndWhatHasNotChanged) {
  base::ThreadPool pool(2);
  Index changed_plans = 0, same = 0, fronts = 0, vanished = 0, fitting = 0;
  for (int number = 0; number < 10; ++number)
    for (unsigned seed = 0; seed < 40; ++seed) {
      SCOPED_TRACE(::testing::Message() << "graph " << number << " seed " << seed);
      std::mt19937 random(seed * 100 + static_cast<unsigned>(number));
      const Graph g = graph_number(number, random);
      const PlanOptions o = random_options(random);
      const SparseMatrix a = matrix_of(g, o.unsymmetric ? Storage::general : Storage::symmetric_lower, true, random);
      const matrix::RowIndex rows = matrix::index_rows(a, pool);
      Plan plan = make_plan(build_tree(g, {}, pool), a, {}, o, pool, &rows);
      const Offset room = elements_with_room(plan.memory);
      for (int round = 0; round < 3; ++round) {
        AssemblyTree tree = plan.tree;
        const std::vector<Index> before = relocate_pivots(tree, random_moves(plan.tree, random));
        vanished += plan.fronts() - tree.fronts();
        auto changed = change_plan(plan, std::move(tree), before, a, {}, rows, pool);
        if (!changed) break;
        EXPECT_EQ(gathered(changed->plan, a), permuted(changed->plan, a, {}));
        check_layout(changed->plan);
        check_tasks(changed->plan);
        check_memory(changed->plan);
        EXPECT_LE(changed->plan.memory.size, room);
        ++changed_plans;
        same += same_fronts(plan, *changed);
        fitting += fitting_contributions(plan, *changed);
        fronts += plan.fronts();
        if (HasFatalFailure()) return;
        plan = std::move(changed->plan);
      }
    }
  EXPECT_GT(changed_plans, 600);
  EXPECT_GT(same, fronts / 3);
  EXPECT_LT(same, fronts);
  EXPECT_GT(fitting, 100);
  EXPECT_GT(vanished, 100);
}

TEST(ChangedPlan, SeveralDevicesNeedAPlanMadeAnew) {
  base::ThreadPool pool(2);
  std::mt19937 random(3);
  const Graph g = analysis::testing::brick(6, 6, 5, 3);
  const SparseMatrix a = matrix_of(g, Storage::symmetric_lower, false, random);
  const matrix::RowIndex rows = matrix::index_rows(a, pool);
  PlanOptions o;
  o.devices = 2;
  const Plan plan = make_plan(build_tree(g, {}, pool), a, {}, o, pool, &rows);
  AssemblyTree tree = plan.tree;
  const std::vector<Index> before = relocate_pivots(tree, analysis::one_front_up(plan.tree, std::vector<Index>{0}));
  EXPECT_FALSE(change_plan(plan, std::move(tree), before, a, {}, rows, pool));
}

}  // namespace
}  // namespace espalier::plan
