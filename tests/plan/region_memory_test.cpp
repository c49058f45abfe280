// Memory of plans: it is used again, shares of devices hold what is theirs, and regions of devices keep what goes to
// the top. Truth: what is alive at every task of the list.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "base/at.hpp"
#include "matrix/generators/generate.hpp"
#include "plan/memory_plan.hpp"
#include "plan/plan.hpp"
#include "plan/regions.hpp"

namespace espalier::plan {
namespace region_memory_test {

using espalier::at;

Plan plan_of(const PlanOptions& options) {
  base::ThreadPool pool(2);
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "8"}), &pool);
  return make_plan(analysis::build_tree(analysis::graph_of(a, pool), {}, pool), a, {}, options, pool);
}

PlanOptions without_ranges(Index devices) {
  PlanOptions o;
  o.devices = devices;
  o.range_flops = 0;
  o.group_entries = 0;
  o.interleave = 1;
  o.reuse_distance = 1;
  return o;
}

struct Alive {
  Offset most = 0, all = 0;  // elements of contributions: at a time, together
};

// Contributions live from the first task of a front to the last one of its parent.
Alive contributions_of(const Plan& p) {
  std::vector<Offset> change(p.tasks.size() + 1, 0);
  Alive found;
  for (Index f = 0; f < p.fronts(); ++f) {
    const Index parent = p.tree.parent[f];
    if (parent < 0) continue;
    const Offset size = p.layout[f].contribution_size();
    found.all += size;
    change[at(p.first_task[f])] += size;
    change[at(p.last_task[parent]) + 1] -= size;
  }
  Offset now = 0;
  for (const Offset c : change) found.most = std::max(found.most, now += c);
  return found;
}

TEST(MemoryOfPlans, IsUsedAgain) {
  for (const Index devices : {1, 2, 3}) {
    const Plan p = plan_of(without_ranges(devices));
    const Alive alive = contributions_of(p);
    ASSERT_LT(2 * alive.most, alive.all);
    EXPECT_LE(p.memory.size - p.memory.factor_size, (devices == 1 ? 1.25 : 2.5) * static_cast<double>(alive.most))
        << devices;
  }
}

class TwiceTheSize : public ArrayLayout {
 public:
  [[nodiscard]] Offset factor_elements(const FrontLayout& l, FrontForm) const override { return 2 * l.factor_size(); }
  [[nodiscard]] Offset contribution_elements(const FrontLayout& l, FrontForm) const override {
    return 2 * l.contribution_size();
  }
};

// What a region passes on to the top stays, whatever begins in the region later.
TEST(MemoryOfPlans, OfRegionsKeepsWhatGoesToTheTop) {
  const TwiceTheSize arrays;
  for (const Index devices : {2, 3}) {
    PlanOptions o = without_ranges(devices);
    o.arrays = &arrays;
    o.additional_subtrees = 2;
    const Plan p = plan_of(o);
    const Regions regions = name_regions(p, true);
    ASSERT_GT(static_cast<Index>(regions.device.size()), 1 + devices) << "some can be stolen";
    EXPECT_TRUE(std::is_sorted(p.memory.wait_ptr.begin(), p.memory.wait_ptr.end()));
    EXPECT_EQ(p.memory.wait_ptr.back(), static_cast<Offset>(p.memory.wait_fronts.size()));
    Index passed_on = 0;
    for (Index f = 0; f < p.fronts(); ++f) {
      const Index parent = p.tree.parent[f];
      if (regions.of[f] == 0 || parent < 0 || regions.of[parent] == regions.of[f]) continue;
      ++passed_on;
      const Offset begin = p.memory.contribution[f], end = begin + 2 * p.layout[f].contribution_size();
      EXPECT_LE(end, p.memory.device_size[at(regions.of[f])]);
      for (Index g = 0; g < p.fronts(); ++g) {
        if (g == f || regions.of[g] != regions.of[f] || p.last_task[g] <= p.first_task[f]) continue;
        const Offset factor = p.memory.factor[g], left = p.memory.contribution[g];
        EXPECT_TRUE(factor >= end || factor + 2 * p.layout[g].factor_size() <= begin) << f << ' ' << g;
        EXPECT_TRUE(left >= end || left + 2 * p.layout[g].contribution_size() <= begin) << f << ' ' << g;
      }
    }
    EXPECT_GE(passed_on, devices);
    // What a device holds: its regions, and the factors of the top.
    Offset top = 0, together = 0, of_regions = 0;
    for (Index f = 0; f < p.fronts(); ++f)
      if (regions.of[f] == 0) top += 2 * p.layout[f].factor_size();
    for (const Offset size : elements_by_device(p)) together += size;
    for (std::size_t r = 1; r < p.memory.device_size.size(); ++r) of_regions += p.memory.device_size[r];
    EXPECT_GE(together, of_regions + devices * top);
  }
}

// Fronts of one tier advance together, `interleave` at a time: the tasks of two stand between one another.
TEST(TasksOfPlans, AdvanceTogetherAsManyAsAsked) {
  PlanOptions o = without_ranges(1);
  o.group_entries = Offset{1} << 40;
  o.tiles.whole_rows = 1;
  o.tiles.whole_pivots = 1;
  o.tiles.max_block_size = 8;
  for (const Index interleave : {1, 3}) {
    o.interleave = interleave;
    const Plan p = plan_of(o);
    std::vector<Index> open(p.tasks.size() + 1, 0);
    for (Index f = 0; f < p.fronts(); ++f) {
      ++open[at(p.first_task[f])];
      --open[at(p.last_task[f]) + 1];
    }
    Index now = 0, most = 0;
    for (const Index change : open) most = std::max(most, now += change);
    EXPECT_EQ(most, interleave);
  }
}

}  // namespace region_memory_test
}  // namespace espalier::plan
