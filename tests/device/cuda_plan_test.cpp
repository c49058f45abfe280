// The CUDA backend's tables, without a GPU: every flag that a task waits for is set by an earlier task, arrays of
// fronts that are alive at the same time do not overlap. Truth: the definitions in device/cuda/tables.hpp, replayed in
// order.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "analysis/ordering.hpp"
#include "cuda_plan_flags.hpp"
#include "device/cuda/tables/device_bytes.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "device/cuda/tables/path_tasks.hpp"
#include "device/cuda/tables/tile_tasks.hpp"
#include "matrix/generators/generate.hpp"
#include "parameters.hpp"

namespace espalier {
namespace cuda_plan_test {

using device::cuda::DevicePlan;
using device::cuda::FactorTask;
using device::cuda::Front;
using device::cuda::Work;

struct Parameter {
  std::vector<std::string> words;
  Kind kind;
  friend void PrintTo(const Parameter& p, std::ostream* out) { test::print(*out, p.words, p.kind); }
};

/// Whether there are more than 64 rows of a row block below two wide tile columns of one row block.
bool has_two_columns(const Front& f) {
  for (int j = 0; f.width == 64 && j + 1 < f.tiles; ++j) {
    const bool even = (j < f.pivot_tiles ? j : j - f.pivot_tiles) % 2 == 0, split = j + 1 == f.pivot_tiles;
    for (int a = 0; a < f.blocks && even && !split; ++a)
      if (f.block_begin(a) >= f.column_end(j + 1) && f.block_end(a) - f.block_begin(a) > 64) return true;
  }
  return false;
}

class CudaPlan : public ::testing::TestWithParam<Parameter> {
 protected:
  void SetUp() override {
    a_ = matrix::generate(matrix::parse_generator(GetParam().words), &pool_);
    device::cuda::DeviceTuning tuning;
    tuning.narrow_rows = 300;  // small systems, too, shall have wide fronts
    tuning.group_entries = 1 << 18;
    tuning.reuse_distance = 64;
    auto tree = analysis::build_tree(analysis::graph_of(a_, pool_), {}, pool_);
    plan_ = plan::make_plan(std::move(tree), a_, {}, device::cuda::cuda_plan_options(GetParam().kind, tuning), pool_);
    device_ = device::cuda::make_device_plan(plan_, GetParam().kind);
    lists_ = device_.lists.front();
  }

  base::ThreadPool pool_{2};
  SparseMatrix a_;
  plan::Plan plan_;
  DevicePlan device_;
  device::cuda::TaskLists lists_;
};

// In the order of large fronts, too, whose rectangles and pairs small ones are too short for.
TEST_P(CudaPlan, EveryFlagIsSetByAnEarlierTask) {
  std::size_t two_columns = 0;
  const std::size_t tasks = lists_.tasks.size();
  for (const device::cuda::TaskOrder& order :
       {device::cuda::TaskOrder{},
        {1, 1, 1 << 30},
        {2, 1, 0},
        {3, 2, 1},
        {4, 2, 2},
        device::cuda::TaskOrder{.two_columns = true},
        {.group_columns = 3, .group_blocks = 2, .pair_from = 1, .two_columns = true, .two_pivot_columns_from = 0},
        {.two_columns = true, .two_pivot_columns_from = 2}}) {
    SCOPED_TRACE(::testing::Message() << order.group_columns << ", " << order.group_blocks << ", " << order.pair_from
                                      << (order.two_columns ? ", two columns" : ""));
    const DevicePlan plan = device::cuda::make_device_plan(plan_, GetParam().kind, true, order);
    const auto& list = plan.lists.front().tasks;
    const auto twice = static_cast<std::size_t>(
        std::count_if(list.begin(), list.end(), [](const FactorTask& t) { return t.work == Work::two_columns; }));
    ASSERT_EQ(list.size() + twice, tasks) << "the same tiles in any order";
    two_columns += order.two_columns ? twice : 0;
    ASSERT_TRUE(order.two_columns || twice == 0);
    std::vector<char> set(static_cast<std::size_t>(plan.flags), 0);
    std::vector<std::int32_t> of_front(plan.fronts.size(), 0);
    std::int64_t checked = 0;
    for (std::size_t at = 0; at < list.size(); ++at) {
      const FactorTask& t = list[at];
      PlanFlags(plan).needed_flags(t, [&](std::int64_t flag, std::int32_t) {
        ASSERT_GE(flag, 0);
        ASSERT_LT(flag, plan.flags);
        ASSERT_NE(set[static_cast<std::size_t>(flag)], 0)
            << "task " << at << " of front " << t.front << " column " << t.column;
        ++checked;
      });
      PlanFlags(plan).own_flags(t, [&](std::int64_t own) {
        ASSERT_LT(own, plan.flags);
        if (t.part == 0) {
          ASSERT_EQ(set[static_cast<std::size_t>(own)], 0) << "two tasks set one flag";
        }
        set[static_cast<std::size_t>(own)] = 1;
      });
      ++of_front[static_cast<std::size_t>(t.front)];
    }
    EXPECT_GT(checked, 0);
    for (std::size_t f = 0; f < of_front.size(); ++f) ASSERT_EQ(of_front[f], plan.fronts[f].tasks) << "front " << f;
  }
  EXPECT_EQ(two_columns > 0, std::any_of(device_.fronts.begin(), device_.fronts.end(), has_two_columns));
}

// Every tile once, in an order in which each finds what it reads, whatever the sizes of pivots and rows below.
TEST(CudaTileTasks, OfFrontsOfAnyShape) {
  device::cuda::DeviceTuning tuning;
  tuning.narrow_rows = 0;
  const plan::TileRule rule = device::cuda::cuda_plan_options(Kind::lu, tuning).tiles;
  std::size_t two_columns = 0;
  for (Index pivots = 97; pivots < 900; pivots += 29)
    for (Index below = 0; below < 700; below += 31)
      for (const Index from : {0, 2, 8}) {
        SCOPED_TRACE(::testing::Message() << pivots << " pivots, " << below << " below, two columns from " << from);
        DevicePlan plan;
        plan.fronts.push_back(
            device::cuda::shape_of(plan::cut_front(pivots, pivots + below, rule), plan::FrontForm::wide));
        const Front& f = plan.fronts.front();
        const auto tiles_of = [&](const device::cuda::TaskOrder& order, auto&& check) {
          std::set<std::tuple<int, int, Index, Index>> tiles;  // diagonal, part, row block, column
          const device::cuda::TileTasks tasks(Kind::lu, order);
          for (Index j = 0; j < f.tiles; ++j)
            tasks.column(f, j, [&](Work work, int part, Index block, Index column) {
              check(FactorTask{0, work, static_cast<std::int8_t>(part), 0, block, column});
              for (Index c = column; c <= column + (work == Work::two_columns ? 1 : 0); ++c)
                EXPECT_TRUE(tiles.emplace(work == Work::diagonal ? 1 : 0, part, block, c).second);
            });
          return tiles;
        };
        std::vector<char> set(static_cast<std::size_t>(f.flags()), 0);
        const auto found = tiles_of({.two_columns = true, .two_pivot_columns_from = from}, [&](const FactorTask& t) {
          PlanFlags(plan).needed_flags(
              t, [&](std::int64_t flag, std::int32_t) { EXPECT_NE(set[static_cast<std::size_t>(flag)], 0); });
          PlanFlags(plan).own_flags(t, [&](std::int64_t flag) { set[static_cast<std::size_t>(flag)] = 1; });
          two_columns += t.work == Work::two_columns ? 1 : 0;
        });
        ASSERT_EQ(found, tiles_of({}, [](const FactorTask&) {}));
        ASSERT_FALSE(::testing::Test::HasFailure());
      }
  EXPECT_GT(two_columns, 10000);
}

TEST_P(CudaPlan, MemoryIsReusedOnlyAfterItsUsers) {
  // Replays the tasks; a front's arrays are taken with its first task, a contribution dies with its parent's last task.
  struct Use {
    std::int64_t begin, end;
    Index front;
    bool contribution;
  };
  std::vector<std::int64_t> first(device_.fronts.size(), -1), last(device_.fronts.size(), -1);
  std::vector<int> count(device_.fronts.size(), 0);
  for (std::size_t at = 0; at < lists_.tasks.size(); ++at) {
    const auto f = static_cast<std::size_t>(lists_.tasks[at].front);
    if (first[f] < 0) first[f] = static_cast<std::int64_t>(at);
    last[f] = static_cast<std::int64_t>(at);
    ++count[f];
  }
  const bool lu = GetParam().kind == Kind::lu;
  std::vector<Use> uses;
  for (Index f = 0; f < plan_.fronts(); ++f) {
    const Front& x = device_.fronts[static_cast<std::size_t>(f)];
    EXPECT_EQ(count[static_cast<std::size_t>(f)], x.tasks);
    uses.push_back({x.factor, x.factor + x.factor_size(), f, false});
    if (lu) uses.push_back({x.second, x.second + x.factor_size(), f, false});
    if (x.below > 0) uses.push_back({x.contribution, x.contribution + x.contribution_size(), f, true});
    if (x.below > 0 && lu) uses.push_back({x.contribution_up, x.contribution_up + x.contribution_size(), f, true});
    ASSERT_LE(x.factor + x.factor_size(), device_.regions[static_cast<std::size_t>(x.region)]);
  }
  std::sort(uses.begin(), uses.end(), [](const Use& p, const Use& q) { return p.begin < q.begin; });
  for (std::size_t p = 0; p < uses.size(); ++p)
    for (std::size_t q = p + 1; q < uses.size() && uses[q].begin < uses[p].end; ++q) {
      const Use& early = first[uses[p].front] < first[uses[q].front] ? uses[p] : uses[q];
      const Use& late = &early == &uses[p] ? uses[q] : uses[p];
      ASSERT_TRUE(early.contribution) << "the factor of front " << early.front << " is overwritten";
      const Index reader = plan_.tree.parent[early.front];
      ASSERT_LT(last[reader], first[late.front])
          << "fronts " << early.front << " and " << late.front << " overlap while both are alive";
    }
}

// The kernels know tiles of 32 and 64 columns: a caller's max_block_size below 64 leaves the narrow ones only.
// What a solve finds free must hold no factor; and the bytes that are told are those of the fronts, one by one.
TEST_P(CudaPlan, FactorsLieBeforeWhatIsFreeBetweenFactorizations) {
  const Kind kind = GetParam().kind;
  std::int64_t factors = 0;
  const auto lies_before = [&](std::int64_t at, const Front& f) {
    EXPECT_LE(at + f.factor_size(), device_.kept);
    factors += (f.factor_size() + 15) / 16 * 16;
  };
  for (const Front& f : device_.fronts) {
    lies_before(f.factor, f);
    if (kind == Kind::lu) lies_before(f.second, f);
  }
  EXPECT_EQ(device_.kept, factors) << "no gaps";
  EXPECT_LE(device_.kept, device_.regions[0]);

  const auto b = device::cuda::bytes_of(plan_, kind, device_, 0, a_.nonzeros(), 8);
  EXPECT_EQ(b.factor, 8 * factors);
  EXPECT_EQ(b.factor + b.contributions, 8 * device_.regions[0]);
  EXPECT_EQ(b.factor_entries, 8 * plan_.nonzeros_factor);
  const Offset solve = 8 * (2 * Offset{a_.rows} + static_cast<Offset>(plan_.relative.size()));
  const Offset pivots = 8 * (kind == Kind::ldlt ? 3 : 1) * Offset{a_.rows};
  EXPECT_EQ(b.vectors, pivots + (solve <= b.contributions ? 0 : solve));
  EXPECT_EQ(b.values, 8 * a_.nonzeros());
}

TEST_P(CudaPlan, WidestBlockIsTheCallers) {
  const auto widest = [&](Index max_block_size) {
    device::cuda::DeviceTuning tuning;
    tuning.narrow_rows = 0;  // all others have wide ones
    tuning.max_block_size = max_block_size;
    auto tree = analysis::build_tree(analysis::graph_of(a_, pool_), {}, pool_);
    const plan::PlanOptions options = device::cuda::cuda_plan_options(GetParam().kind, tuning);
    const auto plan = plan::make_plan(std::move(tree), a_, {}, options, pool_);
    int width = 0;
    for (const Front& f : device::cuda::make_device_plan(plan, GetParam().kind).fronts)
      if (f.whole == 0) width = std::max(width, static_cast<int>(f.width));
    return width;
  };
  EXPECT_EQ(widest(0), 64);
  EXPECT_EQ(widest(512), 64);
  EXPECT_EQ(widest(63), 32);
  EXPECT_EQ(widest(1), 32);
}

TEST_P(CudaPlan, SolveTasksFollowTheTree) {
  std::vector<std::int64_t> up(device_.fronts.size(), -1), down(device_.fronts.size(), -1);
  for (std::size_t k = 0; k < lists_.up.size(); ++k) up[lists_.up[k].front] = static_cast<std::int64_t>(k);
  for (std::size_t k = 0; k < lists_.down.size(); ++k) down[lists_.down[k].front] = static_cast<std::int64_t>(k);
  for (Index f = 0; f < plan_.fronts(); ++f) {
    const Index p = plan_.tree.parent[f];
    ASSERT_GE(up[f], 0);
    ASSERT_GE(down[f], 0);
    if (p < 0) continue;
    EXPECT_LT(up[f], up[p]);
    EXPECT_GT(down[f], down[p]);
  }
}

// Truth: the lists filtered by hand, and that what a block waits for is made before it.
TEST_P(CudaPlan, TasksOnPathsAreThoseOfTheirFronts) {
  std::mt19937 random(3);
  for (int run = 0; run < 20; ++run) {
    std::vector<char> up(device_.fronts.size(), 0), down(device_.fronts.size(), 0);
    const auto mark = [&](std::vector<char>& marks) {
      for (auto f = static_cast<Index>(random() % marks.size()); f >= 0; f = plan_.tree.parent[f])
        marks[static_cast<std::size_t>(f)] = 1;
    };
    for (int k = 0; k < run % 7; ++k) mark(up);
    for (int k = 0; k < run % 5; ++k) mark(down);
    const device::cuda::PathTasks some = device::cuda::tasks_on_paths(lists_, {up, down});
    std::vector<std::pair<int, int>> expected, found;
    std::int64_t small_up = 0, small_down = 0;
    for (std::size_t k = 0; k < lists_.up.size(); ++k)
      if (up[static_cast<std::size_t>(lists_.up[k].front)] != 0) {
        expected.emplace_back(lists_.up[k].front, lists_.up[k].block);
        small_up += k < static_cast<std::size_t>(lists_.small_up);
      }
    for (std::size_t k = 0; k < lists_.down.size(); ++k)
      if (const auto f = static_cast<std::size_t>(lists_.down[k].front); down[f] != 0) {
        expected.emplace_back(lists_.down[k].front, up[f] != 0 ? lists_.down[k].block : -1 - lists_.down[k].block);
        small_down += k >= lists_.down.size() - static_cast<std::size_t>(lists_.small_down);
      }
    for (const auto* list : {&some.up, &some.down})
      for (const device::cuda::SolveTask& t : *list) found.emplace_back(t.front, t.block);
    EXPECT_EQ(found, expected);
    EXPECT_EQ(some.small_up, small_up);
    EXPECT_EQ(some.small_down, small_down);
    std::vector<std::int32_t> fronts;
    for (std::size_t f = 0; f < up.size(); ++f) {
      EXPECT_EQ(some.marks[f], (up[f] != 0 ? device::cuda::kPathUp : 0) | (down[f] != 0 ? device::cuda::kPathDown : 0));
      if (some.marks[f] != 0) fronts.push_back(static_cast<std::int32_t>(f));
    }
    EXPECT_EQ(some.fronts, fronts);
  }
}

// A solve with L L^T passes a row block of pivots in one product where it takes the front by row blocks.
TEST_P(CudaPlan, EveryBlockOfPivotsIsInvertedOnce) {
  std::vector<char> by_blocks(device_.fronts.size(), 0);
  for (auto k = static_cast<std::size_t>(lists_.small_up); k < lists_.up.size(); ++k)
    if (lists_.up[k].block >= 0) by_blocks[static_cast<std::size_t>(lists_.up[k].front)] = 1;
  std::vector<std::vector<Index>> listed(device_.fronts.size());
  for (const device::cuda::SolveTask& task : lists_.inverses)
    listed[static_cast<std::size_t>(task.front)].push_back(task.block);
  for (std::size_t f = 0; f < listed.size(); ++f) {
    const Front& x = device_.fronts[f];
    std::vector<Index> expected;
    if (GetParam().kind == Kind::llt && by_blocks[f] != 0 && x.pivot_tiles > 1)
      for (Index a = 0; a < x.pivot_blocks; ++a) expected.push_back(a);
    EXPECT_EQ(listed[f], expected) << "front " << f;
    EXPECT_EQ(x.inverted, expected.empty() ? x.width : device::cuda::kRowBlock) << "front " << f;
  }
  if (GetParam().words == std::vector<std::string>{"elasticity", "10"}) {
    EXPECT_FALSE(lists_.inverses.empty());
  }
}

INSTANTIATE_TEST_SUITE_P(
    Systems, CudaPlan,
    ::testing::Values(Parameter{{"elasticity", "10"}, Kind::llt}, Parameter{{"elasticity", "7"}, Kind::ldlt},
                      Parameter{{"gyroscopic", "7"}, Kind::lu}, Parameter{{"gyroscopic", "10"}, Kind::lu},
                      Parameter{{"poisson", "9"}, Kind::llt}, Parameter{{"plate", "30", "30"}, Kind::llt},
                      Parameter{{"kkt", "5", "3", "2", "2"}, Kind::ldlt}),
    [](const auto& tested) {
      std::string name;
      for (const auto& w : tested.param.words) name += w + "_";
      return name + (tested.param.kind == Kind::llt ? "llt" : tested.param.kind == Kind::ldlt ? "ldlt" : "lu");
    });

}  // namespace cuda_plan_test
}  // namespace espalier
