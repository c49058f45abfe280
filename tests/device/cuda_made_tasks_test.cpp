// The lists of a GPU that makes some fronts again, without a GPU: random sets of fronts, closed under parents, of
// random systems. Truth: the definitions in device/cuda/tables/tables.hpp, replayed in order.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "analysis/ordering.hpp"
#include "analysis/tree_change.hpp"
#include "base/at.hpp"
#include "cuda_plan_flags.hpp"
#include "device/cuda/tables/device_bytes.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "device/cuda/tables/made_tasks.hpp"
#include "matrix/generators/generate.hpp"
#include "plan/kept_entries.hpp"
#include "plan/kept_places.hpp"
#include "plan/reached_fronts.hpp"
#include "reference/reference.hpp"

namespace espalier {
namespace cuda_made_tasks_test {

using device::cuda::DevicePlan;
using device::cuda::FactorTask;
using device::cuda::Front;
using device::cuda::MadeTasks;
using reference::Values;

struct Planned {
  plan::Plan plan;
  DevicePlan tables;
};

Planned planned(const SparseMatrix& a, Kind kind, bool keeps, Index narrow_rows = 300) {
  base::ThreadPool pool(2);
  device::cuda::DeviceTuning tuning;
  tuning.narrow_rows = narrow_rows;
  tuning.group_entries = 1 << 18;
  tuning.reuse_distance = 64;  // so that places are taken over in small systems, too
  plan::PlanOptions options = device::cuda::cuda_plan_options(kind, tuning);
  options.keep_contributions = keeps;
  auto tree = analysis::build_tree(analysis::graph_of(a, pool), {}, pool);
  Planned p;
  p.plan = plan::make_plan(std::move(tree), a, {}, options, pool);
  p.tables = device::cuda::make_device_plan(p.plan, kind);
  return p;
}

SparseMatrix generated(const std::vector<std::string>& words) {
  return matrix::generate(matrix::parse_generator(words));
}

// Random fronts and all above them.
std::vector<char> random_reached(const plan::Plan& plan, std::mt19937& random) {
  std::vector<char> made(at(plan.fronts()), 0);
  const int seeds = std::uniform_int_distribution<int>(0, 4)(random);
  for (int k = 0; k < seeds; ++k) {
    Index f = std::uniform_int_distribution<Index>(0, plan.fronts() - 1)(random);
    for (; f >= 0 && made[at(f)] == 0; f = plan.tree.parent[at(f)]) made[at(f)] = 1;
  }
  return made;
}

void expect_finished(const DevicePlan& tables, const std::vector<char>& made, bool unsymmetric) {
  const MadeTasks some = tasks_of(tables.lists.front(), made);
  std::vector<char> set(at(tables.flags), 0);
  for (std::size_t f = 0; f < made.size(); ++f)
    if (made[f] == 0) std::fill_n(set.begin() + tables.fronts[f].flag0, tables.fronts[f].flags(), 1);
  std::vector<std::int32_t> done(made.size(), 0);
  const PlanFlags flags(tables);
  for (const FactorTask& t : some.tasks) {
    ASSERT_NE(made[at(t.front)], 0);
    flags.needed_flags(t, [&](std::int64_t flag, std::int32_t) { ASSERT_NE(set[at(flag)], 0); });
    flags.own_flags(t, [&](std::int64_t flag) {
      if (t.part == 0) {
        ASSERT_EQ(set[at(flag)], 0) << "it was made already";
      }
      set[at(flag)] = 1;
    });
    ++done[at(t.front)];
  }
  for (std::size_t f = 0; f < made.size(); ++f)
    ASSERT_EQ(done[f], made[f] != 0 ? tables.fronts[f].tasks : 0) << "front " << f << (unsymmetric ? ", lu" : "");
  const auto is_narrow = [&](const FactorTask& t) {
    return tables.fronts[at(t.front)].whole != 0 || tables.fronts[at(t.front)].width <= 32;
  };
  ASSERT_TRUE(std::all_of(some.tasks.begin(), some.tasks.begin() + some.narrow_tasks, is_narrow));
}

TEST(CudaMadeTasks, FindAllThatTheyWaitFor) {
  std::mt19937 random(5);
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
    for (const auto& a : {generated({"elasticity", "7"}), generated({"plate", "30"}),
                          reference::random_system(400, 4, Values::positive, 3)}) {
      const Planned p = planned(a, kind, true);
      for (int k = 0; k < 60; ++k) {
        expect_finished(p.tables, random_reached(p.plan, random), kind == Kind::lu);
        if (HasFatalFailure()) return;
      }
    }
}

void expect_places_apart(const Planned& p, Kind kind) {
  std::vector<std::pair<Offset, Offset>> arrays;
  for (Index f = 0; f < p.plan.fronts(); ++f) {
    const Front& x = p.tables.fronts[at(f)];
    arrays.emplace_back(x.factor, x.factor + x.factor_size());
    if (kind == Kind::lu || (kind == Kind::ldlt && x.whole == 0))
      arrays.emplace_back(x.second, x.second + x.factor_size());
    if (p.plan.tree.parent[at(f)] < 0 || x.below == 0) continue;
    arrays.emplace_back(x.contribution, x.contribution + x.contribution_size());
    if (kind == Kind::lu) arrays.emplace_back(x.contribution_up, x.contribution_up + x.contribution_size());
  }
  std::sort(arrays.begin(), arrays.end());
  for (std::size_t k = 0; k + 1 < arrays.size(); ++k) ASSERT_LE(arrays[k].second, arrays[k + 1].first);
  EXPECT_LE(arrays.back().second, p.tables.kept) << "solves take what is behind";
  EXPECT_LE(p.tables.kept, p.tables.regions[0]);
}

// What fronts have made stays: nobody waits for memory, and no two arrays have a place in common.
TEST(CudaMadeTasks, EveryArrayHasAPlaceOfItsOwn) {
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    const SparseMatrix a = generated({"elasticity", "8"});
    const Planned p = planned(a, kind, true), other = planned(a, kind, false);
    EXPECT_TRUE(p.tables.waits.empty());
    EXPECT_FALSE(other.tables.waits.empty());
    expect_places_apart(p, kind);
  }
}

// Springs between unknowns near each other come to a lower triangle. @param places  where entries of before stand now
SparseMatrix with_springs(const SparseMatrix& a, std::mt19937& random,
                          std::vector<analysis::PatternChange::Edge>& added, plan::SourceMap& places) {
  SparseMatrix b;
  b.rows = b.cols = a.cols;
  b.storage = a.storage;
  b.col_ptr.assign(1, 0);
  std::vector<std::vector<Index>> more(at(a.cols));
  for (int k = 0; k < 3; ++k) {
    const Index u = std::uniform_int_distribution<Index>(0, a.cols - 2)(random);
    const Index v = std::min(a.cols - 1, u + 1 + std::uniform_int_distribution<Index>(0, 40)(random));
    more[at(u)].push_back(v);
  }
  for (Index c = 0; c < a.cols; ++c) {
    const auto begin = a.row_ind.begin() + a.col_ptr[at(c)], end = a.row_ind.begin() + a.col_ptr[at(c) + 1];
    std::vector<Index> rows(begin, end);
    for (const Index r : more[at(c)])
      if (std::find(rows.begin(), rows.end(), r) == rows.end()) {
        rows.push_back(r);
        added.emplace_back(r, c);
      }
    std::sort(rows.begin(), rows.end());
    std::vector<Offset> now;
    for (auto r = begin; r != end; ++r)
      now.push_back(static_cast<Offset>(b.row_ind.size()) + (std::find(rows.begin(), rows.end(), *r) - rows.begin()));
    places.list(a.col_ptr[at(c)], now);
    b.row_ind.insert(b.row_ind.end(), rows.begin(), rows.end());
    b.col_ptr.push_back(static_cast<Offset>(b.row_ind.size()));
  }
  places.close(a.nonzeros());
  b.values.assign(b.row_ind.size(), 1.0);
  return b;
}

// Patterns change; fronts that stay keep their arrays, whoever takes the rest, and what is to be made finds all that it
// waits for.
TEST(CudaMadeTasks, OfChangedPatternsKeepTheirPlaces) {
  base::ThreadPool pool(2);
  std::mt19937 random(17);
  Index staying = 0, fronts = 0;
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu})
    for (const char* n : {"7", "9"}) {
      SparseMatrix a = generated({"elasticity", n});
      Planned p = planned(a, kind, true);
      for (int round = 0; round < 12; ++round) {
        std::vector<analysis::PatternChange::Edge> added;
        plan::SourceMap places;
        SparseMatrix b = with_springs(a, random, added, places);
        const MatrixView view = b;
        const matrix::RowIndex rows = matrix::index_rows(b, pool);
        const analysis::ChangedTree changed = analysis::change_tree(p.plan.tree, {added, {}, {}, view, rows}, pool);
        const plan::KeptEntries kept{p.plan, changed.same, places, {}, {}, {}, true};
        Planned now;
        now.plan = plan::make_plan(changed.tree, b, {}, p.plan.options, pool, &rows, &kept);
        now.tables = device::cuda::make_device_plan(now.plan, kind);
        const plan::FrontsBefore stay = plan::fronts_that_stay(now.plan, p.plan, changed.same);
        expect_places_apart(now, kind);
        std::vector<char> made(at(now.plan.fronts()), 0);
        for (Index f = 0; f < now.plan.fronts(); ++f) {
          const Index o = stay.same[at(f)];
          if (o < 0) made[at(f)] = 1;
          const Index parent = now.plan.tree.parent[at(f)];
          if (made[at(f)] != 0 && parent >= 0) made[at(parent)] = 1;
          if (o < 0) continue;
          ++staying;
          Front mine = now.tables.fronts[at(f)];
          const Front& was = p.tables.fronts[at(o)];
          EXPECT_EQ(mine.factor, was.factor);
          EXPECT_EQ(mine.contribution, parent >= 0 ? was.contribution : mine.contribution);
          if (made[at(f)] == 0) {
            EXPECT_EQ(mine.inverted, was.inverted) << "the inverses of a front that is kept are joined as before";
          }
          EXPECT_EQ(mine.whole, was.whole);
          EXPECT_EQ(mine.width, was.width);
          EXPECT_EQ(mine.flags(), was.flags());
          EXPECT_EQ(mine.tasks, was.tasks);
        }
        fronts += now.plan.fronts();
        expect_finished(now.tables, made, kind == Kind::lu);
        if (HasFatalFailure()) return;
        p = std::move(now);
        a = std::move(b);
      }
    }
  EXPECT_GT(staying, fronts / 3);
  EXPECT_LT(staying, fronts);
}

TEST(CudaMadeTasks, ReachedAreTheFrontsOfOtherValuesAndAllAbove) {
  const SparseMatrix a = generated({"elasticity", "6"});
  const Planned p = planned(a, Kind::llt, true);
  base::ThreadPool pool(2);
  std::mt19937 random(11);
  for (int round = 0; round < 50; ++round) {
    std::vector<double> now = a.values;
    std::vector<char> expected(at(p.plan.fronts()), 0);
    std::vector<Index> place(at(a.cols)), front(at(a.cols));
    for (Index f = 0; f < p.plan.fronts(); ++f)
      for (Index k = p.plan.tree.first[at(f)]; k < p.plan.tree.first[at(f) + 1]; ++k) {
        place[at(p.plan.tree.order[at(k)])] = k;
        front[at(p.plan.tree.order[at(k)])] = f;
      }
    for (int k = 0; k < round % 4; ++k) {
      const Offset q = std::uniform_int_distribution<Offset>(0, a.nonzeros() - 1)(random);
      now[at(q)] *= 1.5;
      if (now[at(q)] == a.values[at(q)]) continue;
      const auto c =
          static_cast<Index>(std::upper_bound(a.col_ptr.begin(), a.col_ptr.end(), q) - a.col_ptr.begin()) - 1;
      const Index r = a.row_ind[at(q)];
      for (Index f = front[at(place[at(r)] < place[at(c)] ? r : c)]; f >= 0; f = p.plan.tree.parent[at(f)])
        expected[at(f)] = 1;
    }
    EXPECT_EQ(plan::fronts_reached<double>(p.plan, now, a.values, pool), expected);
    const double share = plan::share_of_work(p.plan, expected);
    EXPECT_EQ(share == 0, round % 4 == 0 || now == a.values);
    EXPECT_LE(share, 1);
  }
}

TEST(CudaMadeTasks, TheirMemoryIsCounted) {
  const SparseMatrix a = generated({"elasticity", "8"});
  const Planned p = planned(a, Kind::llt, true), other = planned(a, Kind::llt, false);
  const auto bytes = [&](const Planned& of) {
    return device::cuda::bytes_of(of.plan, Kind::llt, of.tables, 0, a.nonzeros(), 8);
  };
  EXPECT_EQ(bytes(p).factor, bytes(other).factor);
  EXPECT_GT(bytes(p).contributions, bytes(other).contributions);
  EXPECT_GE(bytes(p).tasks, bytes(other).tasks + p.plan.fronts());
}

}  // namespace cuda_made_tasks_test
}  // namespace espalier
