// Plans of changed patterns whose fronts keep their places. The truth is what every plan has to keep (plan_checks.hpp),
// and the plan before: what stays has the same columns, rows and children, and its arrays in the same places.
#include "plan/kept_places.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>
#include <vector>

#include "analysis/tree_change.hpp"
#include "plan/plan_checks.hpp"

namespace espalier::plan {
namespace {

using namespace testing;

PlanOptions options_that_keep(std::mt19937& random) {
  PlanOptions o = random_tiles(random);
  o.keep_contributions = true;
  return o;
}

// Some edges come and some go, each in one direction.
struct NextGraph {
  Graph graph;
  std::vector<std::pair<Index, Index>> added, removed;
};

NextGraph changed_graph(const Graph& g, std::mt19937& random) {
  std::vector<std::pair<Index, Index>> edges;
  NextGraph next;
  for (Index u = 0; u < g.n; ++u)
    for (const Index v : g.neighbours(u)) {
      if (v > u) continue;
      if (random() % 400 == 0)
        next.removed.emplace_back(u, v);
      else
        edges.emplace_back(u, v);
    }
  for (unsigned k = random() % 4; k > 0 && g.n > 2; --k) {
    const auto u = static_cast<Index>(random() % static_cast<unsigned>(g.n));
    const Index v = std::min<Index>(g.n - 1, u + 1 + static_cast<Index>(random() % 20));
    const auto there = g.neighbours(u);
    if (u == v || std::find(there.begin(), there.end(), v) != there.end()) continue;
    if (std::find(next.added.begin(), next.added.end(), std::pair{v, u}) != next.added.end()) continue;
    next.added.emplace_back(v, u);
    edges.emplace_back(v, u);
  }
  next.graph = analysis::testing::graph_of_edges(g.n, edges);
  return next;
}

Index expect_stay(const Plan& before, const Plan& plan, const FrontsBefore& stay) {
  Index staying = 0;
  const AssemblyTree &t = plan.tree, &was = before.tree;
  const MemoryPlan &m = plan.memory, &then = before.memory;
  EXPECT_TRUE(stay.of_pattern);
  for (Index f = 0; f < t.fronts(); ++f) {
    const Index o = stay.same[f];
    if (o < 0) continue;
    ++staying;
    EXPECT_EQ(m.factor[f], then.factor[o]);
    if (plan.options.unsymmetric) {
      EXPECT_EQ(m.factor2[f], then.factor2[o]);
    }
    if (m.on_stack[f] == 0 && t.parent[f] >= 0 && plan.layout[f].contribution_size() > 0) {
      EXPECT_EQ(then.on_stack[o], 0);
      EXPECT_EQ(m.contribution[f], then.contribution[o]);
      if (plan.options.unsymmetric) {
        EXPECT_EQ(m.contribution2[f], then.contribution2[o]);
      }
    }
    EXPECT_EQ(t.pivots(f), was.pivots(o));
    EXPECT_EQ(t.rows_below(f), was.rows_below(o));
    for (Index k = 0; k < t.pivots(f); ++k) EXPECT_EQ(t.order[t.first[f] + k], was.order[was.first[o] + k]);
    for (Index r = 0; r < t.rows_below(f); ++r)
      EXPECT_EQ(t.order[t.rows[t.row_ptr[f] + r]], was.order[was.rows[was.row_ptr[o] + r]]);
    const Offset children = plan.child_ptr[f + 1] - plan.child_ptr[f];
    EXPECT_EQ(children, before.child_ptr[o + 1] - before.child_ptr[o]);
    for (Offset c = 0; c < children; ++c)  // of a child that does not stay, nothing is known: a parent is made then
      EXPECT_EQ(was.order[was.first[before.children[before.child_ptr[o] + c]]],
                t.order[t.first[plan.children[plan.child_ptr[f] + c]]]);
  }
  return staying;
}

TEST(KeptPlaces, HaveThePromisesOfAPlanAndWhatStays) {
  base::ThreadPool pool(2);
  Index plans = 0, staying = 0, fronts = 0, no_room = 0;
  for (int number = 0; number < 10; ++number)
    for (unsigned seed = 0; seed < 8; ++seed) {
      SCOPED_TRACE(::testing::Message() << "graph " << number << " seed " << seed);
      std::mt19937 random(seed * 100 + static_cast<unsigned>(number));
      Graph g = graph_number(number, random);
      const PlanOptions o = options_that_keep(random);
      const Storage storage = o.unsymmetric ? Storage::general : Storage::symmetric_lower;
      SparseMatrix a = matrix_of(g, storage, false, random);
      Plan plan = make_plan(build_tree(g, {}, pool), a, {}, o, pool);
      const Offset room = elements_with_room(plan.memory);
      for (int round = 0; round < 12; ++round) {
        NextGraph next = changed_graph(g, random);
        const SparseMatrix b = matrix_of(next.graph, storage, false, random);
        const MatrixView view = b;
        const matrix::RowIndex rows = matrix::index_rows(b, pool);
        const analysis::ChangedTree changed =
            analysis::change_tree(plan.tree, {next.added, next.removed, {}, view, rows}, pool);
        Plan now = make_plan(changed.tree, b, {}, o, pool, &rows);
        const MemoryPlan alone = now.memory;
        if (!place_as_before(now, plan, changed.same)) {
          ++no_room;
          EXPECT_EQ(now.memory.size, 0);
          break;
        }
        check_memory(now);
        if (HasFatalFailure()) return;
        EXPECT_EQ(now.memory.on_stack, alone.on_stack);
        EXPECT_EQ(now.memory.stack_size, alone.stack_size);
        EXPECT_LE(now.memory.size, room);
        EXPECT_EQ(elements_with_room(now.memory), room);
        staying += expect_stay(plan, now, fronts_that_stay(now, plan, changed.same));
        fronts += now.fronts();
        ++plans;
        plan = std::move(now);
        g = std::move(next.graph);
      }
    }
  EXPECT_GT(plans, 500);
  EXPECT_LT(no_room, 40);
  EXPECT_GT(staying, fronts / 2);
  EXPECT_LT(staying, fronts);
}

TEST(KeptPlaces, AreNoneWherePlacesPassFromFrontToFront) {
  base::ThreadPool pool(2);
  std::mt19937 random(3);
  const Graph g = analysis::testing::brick(6, 6, 5, 3);
  const SparseMatrix a = matrix_of(g, Storage::symmetric_lower, false, random);
  for (const Index devices : {1, 2}) {
    PlanOptions o;
    o.devices = devices;
    o.keep_contributions = devices > 1;
    Plan plan = make_plan(build_tree(g, {}, pool), a, {}, o, pool);
    std::vector<Index> same(static_cast<std::size_t>(plan.fronts()));
    for (std::size_t f = 0; f < same.size(); ++f) same[f] = static_cast<Index>(f);
    const Plan before = plan;
    EXPECT_FALSE(place_as_before(plan, before, same));
    for (const Index f : fronts_that_stay(before, before, same).same) EXPECT_EQ(f, -1);
  }
}

}  // namespace
}  // namespace espalier::plan
