// Sub-trees over devices: the cut, the list of tasks and the memory of a plan for several devices. Truth: the rules of
// plan/ownership.hpp, checked task by task and front by front; Graham's bound for largest-first lists.
#include "plan/ownership.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "matrix/generators/generate.hpp"
#include "plan/front_layout.hpp"
#include "plan/plan.hpp"

namespace espalier {
namespace {

struct Parameter {
  std::vector<std::string> words;
  Index devices;
  friend void PrintTo(const Parameter& p, std::ostream* out) {
    *out << fmt::format("{} on {}", fmt::join(p.words, " "), p.devices);
  }
};

class OwnershipOfTasks : public ::testing::TestWithParam<Parameter> {
 protected:
  void SetUp() override {
    a_ = matrix::generate(matrix::parse_generator(GetParam().words), &pool_);
    plan_ = plan_for(GetParam().devices);
  }

  plan::Plan plan_for(Index devices) {
    plan::PlanOptions options;
    options.devices = devices;
    options.unsymmetric = a_.storage == Storage::general;
    options.group_entries = 1 << 14;  // small systems, too, shall be walked branch by branch
    return plan::make_plan(analysis::build_tree(analysis::graph_of(a_, pool_), {}, pool_), a_, {}, options, pool_);
  }

  base::ThreadPool pool_{2};
  SparseMatrix a_;
  plan::Plan plan_;
};

TEST_P(OwnershipOfTasks, EveryFrontIsInOneSubTreeOrAboveAll) {
  const auto& a = plan_.ownership;
  std::vector<int> roots(static_cast<std::size_t>(plan_.fronts()), 0);
  for (std::size_t s = 0; s < a.subtrees.size(); ++s)
    for (const Index f : a.subtrees[s].roots) {
      EXPECT_EQ(a.subtree(f), static_cast<Index>(s));
      ++roots[static_cast<std::size_t>(f)];
    }
  for (Index f = 0; f < plan_.fronts(); ++f) {
    const Index parent = plan_.tree.parent[f];
    const bool root = a.subtree(f) >= 0 && (parent < 0 || a.subtree(parent) < 0);
    EXPECT_EQ(roots[static_cast<std::size_t>(f)], root ? 1 : 0);
    if (parent >= 0 && a.subtree(parent) >= 0) {
      EXPECT_EQ(a.subtree(f), a.subtree(parent));
    }
  }
}

TEST_P(OwnershipOfTasks, LargestFirstKeepsGrahamsBound) {
  // A list schedule ends at most one piece after the mean: load <= total / N + (1 - 1/N) largest.
  const auto& a = plan_.ownership;
  std::vector<double> load(static_cast<std::size_t>(a.devices), 0);
  double total = 0, largest = 0;
  for (const auto& s : a.subtrees) {
    load[static_cast<std::size_t>(s.device)] += s.seconds;
    total += s.seconds;
    largest = std::max(largest, s.seconds);
  }
  const double n = a.devices;
  EXPECT_LE(*std::max_element(load.begin(), load.end()), (total / n + (1 - 1 / n) * largest) * (1 + 1e-12));
  EXPECT_GE(static_cast<Index>(a.subtrees.size()), a.devices) << "every device has a sub-tree";
}

TEST_P(OwnershipOfTasks, ListHoldsSubTreesThenTheTop) {
  const auto& a = plan_.ownership;
  Index at = 0;
  for (std::size_t s = 0; s < a.subtrees.size(); ++s) {
    EXPECT_EQ(a.subtrees[s].first_task, at);
    for (; at < a.subtrees[s].end_task; ++at) EXPECT_EQ(a.subtree(plan_.tasks[at].front), static_cast<Index>(s));
  }
  EXPECT_EQ(a.top_task, at);
  for (; at < static_cast<Index>(plan_.tasks.size()); ++at) EXPECT_EQ(a.subtree(plan_.tasks[at].front), -1);
  // Operands stand before their users: children end before a parent's last task, and begin before its first.
  for (Index f = 0; f < plan_.fronts(); ++f) {
    const Index parent = plan_.tree.parent[f];
    if (parent >= 0) {
      EXPECT_LE(plan_.last_task[f], plan_.first_task[parent]);
    }
  }
}

TEST_P(OwnershipOfTasks, SubTreesWaitForNobodyElse) {
  const auto& m = plan_.memory;
  for (Index f = 0; f < plan_.fronts(); ++f)
    for (Offset q = m.wait_ptr[f]; q < m.wait_ptr[f + 1]; ++q) {
      const Index g = m.wait_fronts[q];
      EXPECT_LT(plan_.last_task[g], plan_.first_task[f]);
      if (plan_.ownership.subtree(f) >= 0) {
        EXPECT_EQ(plan_.ownership.subtree(g), plan_.ownership.subtree(f)) << "front " << f << " waits for " << g;
      }
    }
}

TEST_P(OwnershipOfTasks, ShardsOfMemoryAddUp) {
  const auto& m = plan_.memory;
  const Index n = plan_.ownership.devices;
  ASSERT_EQ(static_cast<Index>(m.device_size.size()), n);
  const Offset sum = std::accumulate(m.device_size.begin(), m.device_size.end(), Offset{0});
  EXPECT_GE(sum, m.size);
  EXPECT_LT(sum, m.size + n);  // rounding of even parts
  // Each holds the factors of its sub-trees and of its block columns of the top.
  std::vector<Offset> factors(m.device_size.size(), 0);
  const Offset copies = plan_.options.unsymmetric ? 2 : 1;
  for (Index f = 0; f < plan_.fronts(); ++f) {
    const auto& l = plan_.layout[f];
    for (Index j = 0; j < l.pivot_tiles; ++j)
      for (Index i = j; i < l.tiles; ++i)
        factors[static_cast<std::size_t>(plan_.ownership.owner(f, j))] += copies * l.padded(l.width(i)) * l.width(j);
  }
  for (std::size_t d = 0; d < factors.size(); ++d) EXPECT_GE(m.device_size[d], factors[d]) << d;
}

// A device of three times the speed has about three times the work, and the memory for it.
TEST(OwnershipOfMemory, FollowsTheSpeeds) {
  base::ThreadPool pool(2);
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "9"}), &pool);
  plan::PlanOptions options;
  options.devices = 2;
  options.device_speed = {3, 1};
  const plan::Plan p =
      plan::make_plan(analysis::build_tree(analysis::graph_of(a, pool), {}, pool), a, {}, options, pool);
  std::vector<Offset> factors(2, 0);
  std::vector<double> seconds(2, 0);
  for (Index f = 0; f < p.fronts(); ++f)
    if (const Index s = p.ownership.subtree(f); s >= 0)
      factors[static_cast<std::size_t>(p.ownership.subtrees[static_cast<std::size_t>(s)].device)] +=
          p.layout[f].factor_size();
  for (const auto& s : p.ownership.subtrees) seconds[static_cast<std::size_t>(s.device)] += s.seconds;
  EXPECT_GT(seconds[0], 2 * seconds[1]);
  ASSERT_GT(factors[0], factors[1]);
  EXPECT_GE(p.memory.device_size[0] - p.memory.device_size[1], (factors[0] - factors[1]) / 2);
  for (const std::size_t d : {0, 1}) EXPECT_GE(p.memory.device_size[d], factors[d]) << d;
}

TEST_P(OwnershipOfTasks, BlockColumnsOfTheTopAreDealtEvenly) {
  const auto& a = plan_.ownership;
  for (Index f = 0; f < plan_.fronts(); ++f) {
    if (a.subtree(f) >= 0) continue;
    std::vector<int> columns(static_cast<std::size_t>(a.devices), 0);
    for (Index j = 0; j < plan_.layout[f].tiles; ++j) ++columns[static_cast<std::size_t>(a.owner(f, j))];
    int least = plan_.layout[f].tiles, most = 0;
    for (std::size_t d = 0; d < columns.size(); ++d) {
      if ((a.members[static_cast<std::size_t>(f)] >> d & 1) == 0) {
        EXPECT_EQ(columns[d], 0) << "device " << d << " has nothing below front " << f;
        continue;
      }
      least = std::min(least, columns[d]);
      most = std::max(most, columns[d]);
    }
    EXPECT_LE(most - least, 1);
  }
}

TEST_P(OwnershipOfTasks, MembersOfTheTopHaveASubTreeBelow) {
  const auto& a = plan_.ownership;
  std::vector<std::uint64_t> below(static_cast<std::size_t>(plan_.fronts()), 0);
  for (Index f = 0; f < plan_.fronts(); ++f) {
    auto& mine = below[static_cast<std::size_t>(f)];
    if (a.subtree(f) >= 0) mine = std::uint64_t{1} << a.subtrees[static_cast<std::size_t>(a.subtree(f))].device;
    if (mine != 0) {
      EXPECT_EQ(a.members[static_cast<std::size_t>(f)], mine);
    }
    EXPECT_NE(a.members[static_cast<std::size_t>(f)], 0u);
    if (plan_.tree.parent[f] >= 0) below[static_cast<std::size_t>(plan_.tree.parent[f])] |= mine;
  }
}

TEST_P(OwnershipOfTasks, TasksAreThoseOfOneDevice) {
  // The order changes, the work does not: the same tiles, and the same fronts in ranges.
  const auto works = [](const plan::Plan& plan) {
    std::multiset<std::vector<Index>> set;
    for (const auto& t : plan.tasks) set.insert({t.front, t.begin, t.i, t.j});
    return set;
  };
  EXPECT_EQ(works(plan_), works(plan_for(1)));
}

/// Two leaves under a root without contribution, as two devices share it with columns dealt by load.
plan::Plan plan_with_root(Index pivots) {
  plan::Plan plan;
  plan.options.devices = 2;
  plan.options.machine = plan::h200();
  plan.options.balance_columns = true;
  plan.options.column_group = 8;
  plan.options.tiles = {.panel = 16, .max_block_size = 64, .even = false};
  plan.tree.parent = {2, 2, -1};
  for (int leaf = 0; leaf < 2; ++leaf)
    plan.layout.push_back(plan::cut_front(pivots / 20, pivots / 20 + pivots, plan.options.tiles));
  plan.layout.push_back(plan::cut_front(pivots, pivots, plan.options.tiles));
  plan.tier = {1, 1, 0};
  plan.child_ptr = {0, 0, 0, 2};
  plan.children = {0, 1};
  plan.whole.assign(3, 0);
  plan.ownership = plan::assign_owners(plan);
  return plan;
}

TEST(OwnershipOfPivots, AMemberTakesNoMoreColumnsThanItWorksOnAtATime) {
  // 40,000 rows are 313 row blocks of 128: a column is more than the 264 tasks at once, so that no three neighbours
  // have one owner (two may: who has the least to do may be the same twice). Farther on, at 8,000 rows, four fit.
  const plan::Plan large = plan_with_root(40000);
  const auto owner = [&](Index j) { return large.ownership.owner(2, j); };
  for (Index j = 0; j + 2 < large.layout[2].tiles && large.layout[2].rows - large.layout[2].begin(j) > 264 * 128; ++j)
    EXPECT_FALSE(owner(j) == owner(j + 1) && owner(j) == owner(j + 2)) << "column " << j;
  const Index late = (40000 - 8000) / 64;
  bool four = false;
  for (Index j = late; j + 3 < late + 16; ++j)
    four = four || (owner(j) == owner(j + 1) && owner(j) == owner(j + 2) && owner(j) == owner(j + 3));
  EXPECT_TRUE(four);
  // In a small front all eight go together.
  const plan::Plan small = plan_with_root(2000);
  for (Index j = 1; j < 8; ++j) EXPECT_EQ(small.ownership.owner(2, j), small.ownership.owner(2, 0));
  EXPECT_NE(small.ownership.owner(2, 8), small.ownership.owner(2, 0));
}

INSTANTIATE_TEST_SUITE_P(Systems, OwnershipOfTasks,
                         ::testing::Values(Parameter{{"elasticity", "9"}, 2}, Parameter{{"elasticity", "9"}, 8},
                                           Parameter{{"plate", "40", "40"}, 3}, Parameter{{"plate", "40", "40"}, 5},
                                           Parameter{{"kkt", "8", "4", "3", "3"}, 4}, Parameter{{"gyroscopic", "7"}, 4},
                                           Parameter{{"poisson", "14"}, 7}));

}  // namespace
}  // namespace espalier
