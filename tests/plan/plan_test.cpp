// The plan: every entry once and in its place, tiles that cover fronts, a topological task list, and a memory plan in
// which nothing alive is overwritten. The truth is the permuted dense matrix and a slow replay of the task list.
#include "plan/plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "plan/plan_checks.hpp"

namespace espalier::plan {
namespace {

using namespace testing;

void check_plan(const Graph& g, const PlanOptions& options, Storage storage, bool duplicates, std::mt19937& random,
                base::ThreadPool& pool) {
  const SparseMatrix a = matrix_of(g, storage, duplicates, random);
  std::vector<Index> row_of_col;
  if (options.unsymmetric && storage == Storage::general && random() % 2 == 0) {
    // Rows permuted back: the row-permuted matrix has the symmetric pattern of the graph.
    row_of_col.resize(static_cast<std::size_t>(g.n));
    for (Index k = 0; k < g.n; ++k) row_of_col[k] = k;
    std::shuffle(row_of_col.begin(), row_of_col.end(), random);
  }
  SparseMatrix shuffled = a;
  if (!row_of_col.empty())
    for (Index& r : shuffled.row_ind) r = row_of_col[r];
  const Plan p = make_plan(build_tree(g, {}, pool), shuffled, row_of_col, options, pool);
  EXPECT_EQ(gathered(p, shuffled), permuted(p, shuffled, row_of_col));
  check_layout(p);
  check_tasks(p);
  check_memory(p);
  // Nobody takes over a place, so that a front may be kept while others are made again.
  EXPECT_TRUE(!options.keep_contributions || p.memory.wait_fronts.empty());
}

TEST(Plan, HoldsItsPromisesOverTreesTilesKindsAndOptions) {
  base::ThreadPool pool(2);
  std::size_t tasks_checked = 0;
  for (int number = 0; number < 10; ++number)
    for (unsigned seed = 0; seed < 10; ++seed) {
      std::mt19937 random(seed * 100 + static_cast<unsigned>(number));
      SCOPED_TRACE(::testing::Message() << "graph " << number << " seed " << seed);
      const Graph g = graph_number(number, random);
      PlanOptions o;
      const auto pick = [&](std::initializer_list<Index> list) { return *(list.begin() + random() % list.size()); };
      o.tiles.panel = pick({8, 16});
      o.tiles.whole_rows = pick({1, 8, 24, 128});
      o.tiles.whole_pivots = std::min(pick({1, 8, 24, 96}), o.tiles.whole_rows);
      o.tiles.max_block_size = pick({0, 8, 16, 48});
      o.tiles.even = random() % 2 == 0;
      if (random() % 3 == 0) {
        o.tiles.narrow_rows = 60;
        o.tiles.narrow_width = 16;
      }
      const unsigned kind = random() % 3;
      o.unsymmetric = kind == 2;
      o.ldlt = kind == 1;
      o.range_flops = static_cast<double>(pick({0, 100, 10000, 1000000}));
      o.group_entries = pick({0, 100, 5000, 4 << 20});
      o.interleave = pick({1, 2, 4, 50});
      o.reuse_distance = pick({0, 1, 8, 64});
      o.devices = pick({1, 1, 2, 3, 8});
      o.additional_subtrees = pick({0, 1, 3, 10});
      constexpr Storage kSymmetric[] = {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both};
      const Storage storage = o.unsymmetric ? Storage::general : kSymmetric[random() % 3];
      o.keep_contributions = random() % 3 == 0;
      check_plan(g, o, storage, seed % 2 == 0 && storage != Storage::symmetric_both, random, pool);
      if (HasFatalFailure()) return;
      ++tasks_checked;
    }
  EXPECT_EQ(tasks_checked, 100U);
}

TEST(Plan, SameForEveryNumberOfThreads) {
  std::mt19937 random(5);
  const Graph g = analysis::testing::brick(6, 6, 5, 3);
  const SparseMatrix a = matrix_of(g, Storage::symmetric_lower, true, random);
  base::ThreadPool one(1), four(4);
  const AssemblyTree tree = build_tree(g, {}, one);
  const Plan p = make_plan(tree, a, {}, {}, one), q = make_plan(tree, a, {}, {}, four);
  ASSERT_EQ(p.entries.size(), q.entries.size());
  for (std::size_t k = 0; k < p.entries.size(); ++k) {
    ASSERT_EQ(p.entries[k].source(), q.entries[k].source());
    ASSERT_EQ(p.entries[k].row(), q.entries[k].row());
  }
  EXPECT_EQ(p.entry_ptr, q.entry_ptr);
  EXPECT_EQ(p.memory.factor, q.memory.factor);
  EXPECT_EQ(p.memory.contribution, q.memory.contribution);
}

TEST(Plan, TilesWiderThanAnEntryCanSayAreRefused) {
  base::ThreadPool pool(1);
  std::mt19937 random(1);
  const Graph g = analysis::testing::chain(4);
  PlanOptions o;
  o.tiles.max_block_size = 2048;
  EXPECT_THROW(
      (void)make_plan(build_tree(g, {}, pool), matrix_of(g, Storage::symmetric_lower, false, random), {}, o, pool),
      Error);
  // The widest that is accepted is rounded up to whole panels; the last row of such a tile still fits an entry.
  o.tiles.max_block_size = 2047;
  const Index widest = cut_front(5000, 5000, o.tiles).pivot_width;
  const EntryPlace last((Offset{1} << 40) - 1, widest - 1, widest - 1, true);
  EXPECT_EQ(last.row(), widest - 1);
  EXPECT_EQ(last.col(), widest - 1);
  EXPECT_EQ(last.source(), (Offset{1} << 40) - 1);
  EXPECT_TRUE(last.transposed());
}

}  // namespace
}  // namespace espalier::plan
