// The CUDA backend's tables for several devices, without a GPU. Truth: the definitions in device/cuda/tables.hpp. The
// lists are replayed by devices of one block each, which is the hardest case: every task must find what it reads, made
// by an earlier task and brought to its device, and nobody may wait for ever, whoever steals what.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <map>
#include <random>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "analysis/ordering.hpp"
#include "cuda_plan_flags.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "device/cuda/tables/made_tasks.hpp"
#include "device/cuda/tables/needed_values.hpp"
#include "matrix/generators/generate.hpp"
#include "parameters.hpp"
#include "plan/regions.hpp"

namespace espalier {
namespace cuda_devices_test {

using device::cuda::DevicePlan;
using device::cuda::FactorTask;
using device::cuda::Front;

struct Parameter {
  std::vector<std::string> words;
  Kind kind;
  Index devices;
  bool stealing;
  bool shared_top = true;
  friend void PrintTo(const Parameter& p, std::ostream* out) {
    test::print(*out, p.words, p.kind) << " on " << p.devices << (p.stealing ? " stealing" : "")
                                       << (p.shared_top ? "" : " alone");
  }
};

class CudaDevices : public ::testing::TestWithParam<Parameter> {
 protected:
  void SetUp() override {
    a_ = matrix::generate(matrix::parse_generator(GetParam().words), &pool_);
    plan_with({});
  }

  void plan_with(device::cuda::DeviceTuning tuning, bool keeps = false) {
    tuning.narrow_rows = 300;  // small systems, too, shall have wide fronts
    tuning.stealing = GetParam().stealing;
    tuning.shared_top = GetParam().shared_top;
    auto tree = analysis::build_tree(analysis::graph_of(a_, pool_), {}, pool_);
    auto options = device::cuda::cuda_plan_options(GetParam().kind, tuning, GetParam().devices);
    options.keep_contributions = keeps;
    plan_ = plan::make_plan(std::move(tree), a_, {}, options, pool_);
    tables_ = device::cuda::make_device_plan(plan_, GetParam().kind);
  }

  // With every pair of tile columns that one device has as one task.
  void take_two_columns() {
    tables_ = device::cuda::make_device_plan(plan_, GetParam().kind, true,
                                             {.two_columns = true, .two_pivot_columns_from = 0});
  }

  // Bit d: device d learns of the flags that a task of the front sets on device `maker`.
  [[nodiscard]] unsigned told(const Front& f, bool contribution, int maker) const {
    const unsigned others = contribution ? f.readers : f.region == 0 ? f.members : 0u;
    return others | 1u << maker;
  }

  // Tasks of these fronts, by device.
  [[nodiscard]] std::vector<std::vector<FactorTask>> tasks_of(const std::vector<char>& fronts) const {
    std::vector<std::vector<FactorTask>> lists;
    for (const auto& of_device : tables_.lists) lists.push_back(device::cuda::tasks_of(of_device, fronts).tasks);
    return lists;
  }

  // Every device takes its tasks in order; `order` draws who goes on. @returns tasks done
  std::size_t replay(std::mt19937& order, std::vector<int>& stolen_by) {
    std::vector<unsigned> known(static_cast<std::size_t>(tables_.flags), 0);
    return replay(tasks_of(std::vector<char>(tables_.fronts.size(), 1)), order, stolen_by, known);
  }
  // @param known  flags; who knows that it is set
  std::size_t replay(const std::vector<std::vector<FactorTask>>& lists, std::mt19937& order,
                     std::vector<int>& stolen_by, std::vector<unsigned>& known) {
    const PlanFlags flags(tables_);
    const std::size_t devices = lists.size();
    std::vector<std::size_t> next(devices, 0);
    stolen_by.assign(tables_.regions.size(), -1);
    std::size_t done = 0;
    for (std::size_t idle = 0; idle < 64 * devices;) {
      const auto d = static_cast<std::size_t>(order() % devices);
      ++idle;
      for (auto burst = order() % 200; burst > 0 && next[d] < lists[d].size(); --burst) {
        const FactorTask& t = lists[d][next[d]];
        if (t.region >= tables_.first_stealable) {
          int& who = stolen_by[t.region];
          if (who < 0) who = static_cast<int>(d);
          if (who != static_cast<int>(d)) {
            ++next[d];
            idle = 0;
            continue;
          }
        }
        bool ready = true;
        flags.needed_flags(t, [&](std::int64_t flag, std::int32_t) {
          ready = ready && (known[static_cast<std::size_t>(flag)] >> d & 1) != 0;
        });
        if (!ready) break;
        const Front& f = tables_.fronts[static_cast<std::size_t>(t.front)];
        const bool contribution = t.work == device::cuda::Work::whole || t.column >= f.pivot_tiles;
        flags.own_flags(t, [&](std::int64_t flag) {
          known[static_cast<std::size_t>(flag)] |= told(f, contribution, static_cast<int>(d));
        });
        ++next[d];
        ++done;
        idle = 0;
      }
    }
    return done;
  }

  base::ThreadPool pool_{2};
  SparseMatrix a_;
  plan::Plan plan_;
  DevicePlan tables_;
};

TEST_P(CudaDevices, NobodyWaitsForEver) {
  for (const bool two_columns : {false, true}) {
    if (two_columns) take_two_columns();
    std::size_t all = 0;
    for (const Front& f : tables_.fronts) all += static_cast<std::size_t>(f.tasks);
    for (unsigned seed = 1; seed <= 20; ++seed) {
      std::mt19937 order(seed);
      std::vector<int> stolen_by;
      EXPECT_EQ(replay(order, stolen_by), all) << "seed " << seed << (two_columns ? ", two columns" : "");
    }
  }
}

// Fronts that are made again find the others finished, on whatever device, and nobody waits for memory.
TEST_P(CudaDevices, SomeFrontsCanBeMadeAgain) {
  if (GetParam().stealing) return;  // kept fronts are where they were
  plan_with({}, true);
  EXPECT_TRUE(tables_.waits.empty());
  std::mt19937 random(7);
  std::vector<int> stolen_by;
  std::vector<unsigned> known(static_cast<std::size_t>(tables_.flags), 0);
  (void)replay(tasks_of(std::vector<char>(tables_.fronts.size(), 1)), random, stolen_by, known);
  for (int round = 0; round < 40; ++round) {
    std::vector<char> made(tables_.fronts.size(), 0);
    for (auto seeds = random() % 4; seeds > 0; --seeds)
      for (auto f = static_cast<Index>(random() % made.size()); f >= 0; f = plan_.tree.parent[f])
        made[static_cast<std::size_t>(f)] = 1;
    std::vector<unsigned> open = known;
    std::size_t all = 0;
    for (std::size_t f = 0; f < made.size(); ++f) {
      if (made[f] == 0) continue;
      const Front& x = tables_.fronts[f];
      std::fill_n(open.begin() + x.flag0, x.flags(), 0);
      all += static_cast<std::size_t>(x.tasks);
    }
    EXPECT_EQ(replay(tasks_of(made), random, stolen_by, open), all);
    EXPECT_EQ(open, known) << "it is as after a whole run";
  }
}

// Sub-trees' arrays stay: what one front leaves in its region no other takes.
TEST_P(CudaDevices, KeptArraysHavePlacesOfTheirOwn) {
  if (GetParam().stealing) return;
  plan_with({}, true);
  std::map<std::int32_t, std::vector<std::pair<std::int64_t, std::int64_t>>> arrays;
  for (std::size_t k = 0; k < tables_.fronts.size(); ++k) {
    const Front& f = tables_.fronts[k];
    if (f.region == 0) continue;
    const auto add = [&](std::int64_t at, std::int64_t size) {
      if (size > 0) arrays[f.region].emplace_back(at, at + size);
    };
    add(f.factor, f.factor_size());
    if (GetParam().kind == Kind::lu || (GetParam().kind == Kind::ldlt && f.whole == 0)) add(f.second, f.factor_size());
    if (plan_.tree.parent[k] < 0 || f.first_place >= 0) continue;
    add(f.contribution, f.contribution_size());
    if (GetParam().kind == Kind::lu) add(f.contribution_up, f.contribution_size());
  }
  EXPECT_FALSE(arrays.empty());
  const std::vector<Offset> planned = plan::elements_by_device(plan_);
  for (auto& [region, list] : arrays) {
    std::sort(list.begin(), list.end());
    for (std::size_t k = 0; k + 1 < list.size(); ++k) EXPECT_LE(list[k].second, list[k + 1].first);
    EXPECT_LE(list.back().second, tables_.regions[static_cast<std::size_t>(region)]);
  }
  for (std::size_t d = 0; d < planned.size(); ++d) {
    Offset own = tables_.regions[0];
    for (std::size_t r = 1; r < tables_.regions.size(); ++r)
      if (tables_.region_device[r] == static_cast<int>(d)) own += tables_.regions[r];
    EXPECT_LE(own, planned[d]);
    EXPECT_LE(planned[d], own + own / 2 + tables_.place_space[d] * 2) << "what the solver takes it to need";
  }
}

// Two tile columns are one task where one device has both, and no tile is made twice or by nobody.
TEST_P(CudaDevices, TwoColumnsAreTilesOfOneOwner) {
  device::cuda::DeviceTuning tuning;
  tuning.column_group = 3;  // pairs have one owner or two
  plan_with(tuning);
  const auto tiles = [&] {
    std::map<std::tuple<std::int32_t, int, std::int32_t, std::int32_t>, std::size_t> made;
    for (std::size_t d = 0; d < tables_.lists.size(); ++d)
      for (const FactorTask& t : tables_.lists[d].tasks) {
        if (t.work == device::cuda::Work::whole || t.region >= tables_.first_stealable) continue;
        const int sort = t.work == device::cuda::Work::diagonal ? 2 : t.part;
        for (int c = 0; c < (t.work == device::cuda::Work::two_columns ? 2 : 1); ++c)
          EXPECT_TRUE(made.emplace(std::tuple(t.front, sort, t.block, t.column + c), d).second) << "front " << t.front;
      }
    return made;
  };
  const auto before = tiles();
  take_two_columns();
  EXPECT_EQ(tiles(), before);
}

TEST_P(CudaDevices, EveryTaskHasOneOwner) {
  // Without thefts, the lists hold every task of every front once; a stealable sub-tree stands in all of them.
  std::vector<int> count(tables_.fronts.size(), 0);
  for (std::size_t d = 0; d < tables_.lists.size(); ++d)
    for (const FactorTask& t : tables_.lists[d].tasks) {
      const Front& f = tables_.fronts[static_cast<std::size_t>(t.front)];
      EXPECT_EQ(t.region, f.region);
      if (f.region >= tables_.first_stealable &&
          tables_.region_device[static_cast<std::size_t>(f.region)] != static_cast<int>(d))
        continue;
      ++count[static_cast<std::size_t>(t.front)];
      EXPECT_NE(f.members >> d & 1, 0) << "device " << d << " works on front " << t.front;
    }
  for (std::size_t f = 0; f < count.size(); ++f) EXPECT_EQ(count[f], tables_.fronts[f].tasks);
}

// All devices have room for the factor of every front of the top, and nobody reuses what it passes on: what one device
// could do alone does not belong there.
TEST_P(CudaDevices, TheTopBelongsToSeveral) {
  if (GetParam().stealing || !GetParam().shared_top) return;  // sub-trees stay as they were cut
  const plan::Ownership& a = plan_.ownership;
  Index top = 0;
  for (Index f = 0; f < plan_.fronts(); ++f) {
    if (a.subtree(f) >= 0) continue;
    ++top;
    EXPECT_GT(std::popcount(a.members[static_cast<std::size_t>(f)]), 1) << "front " << f;
  }
  EXPECT_GT(top, 0);
  std::set<Index> devices;
  for (const plan::SubTree& s : a.subtrees) {
    devices.insert(s.device);
    EXPECT_FALSE(s.roots.empty());
    EXPECT_GT(s.seconds, 0);
    for (const Index root : s.roots) EXPECT_EQ(&a.subtrees[static_cast<std::size_t>(a.subtree(root))], &s);
  }
  EXPECT_EQ(static_cast<Index>(devices.size()), a.devices) << "every device has a sub-tree";
}

TEST_P(CudaDevices, FactorsAndPlacesDoNotOverlap) {
  struct Range {
    std::int64_t space, begin, end;
  };
  std::vector<Range> ranges;
  const bool lu = GetParam().kind == Kind::lu;
  for (const Front& f : tables_.fronts) {
    ranges.push_back({f.region, f.factor, f.factor + f.factor_size()});
    if (lu) ranges.push_back({f.region, f.second, f.second + f.factor_size()});
    EXPECT_LE(f.factor + f.factor_size(), tables_.regions[static_cast<std::size_t>(f.region)]);
    if (f.region != 0 || f.below == 0 || f.first_place < 0) continue;
    for (int part = 0; part < (lu ? 2 : 1); ++part)
      for (int b = 0; b < f.tiles - f.pivot_tiles; ++b) {
        const auto& p = tables_.places[static_cast<std::size_t>(f.place(b, part))];
        const std::int64_t first = std::int64_t{b} * f.width;
        const std::int64_t columns = std::min<std::int64_t>(f.width, f.below - first);
        ranges.push_back({1000 + p.device, p.offset, p.offset + columns * (f.below_ld - first)});
        EXPECT_LE(ranges.back().end, tables_.place_space[static_cast<std::size_t>(p.device)]);
      }
  }
  std::sort(ranges.begin(), ranges.end(),
            [](const Range& x, const Range& y) { return x.space != y.space ? x.space < y.space : x.begin < y.begin; });
  for (std::size_t k = 1; k < ranges.size(); ++k)
    if (ranges[k].space == ranges[k - 1].space) {
      EXPECT_GE(ranges[k].begin, ranges[k - 1].end);
    }
}

TEST_P(CudaDevices, SolveHasWhatItReads) {
  for (std::size_t d = 0; d < tables_.lists.size(); ++d) {
    std::vector<char> up(tables_.fronts.size(), 0), down(tables_.fronts.size(), 0);
    for (const auto& t : tables_.lists[d].up) {
      const Front& f = tables_.fronts[static_cast<std::size_t>(t.front)];
      EXPECT_NE(f.members >> d & 1, 0);
      for (int l = f.link_begin; l < f.link_end; ++l) {
        const auto child = static_cast<std::size_t>(tables_.links[static_cast<std::size_t>(l)].child);
        const Front& c = tables_.fronts[child];
        // Updates of a child are made here before, or sent by its members.
        if ((c.members >> d & 1) != 0) {
          EXPECT_NE(up[child], 0);
        } else {
          EXPECT_NE(c.readers >> d & 1, 0);
        }
      }
      up[static_cast<std::size_t>(t.front)] = 1;
    }
    for (const auto& t : tables_.lists[d].down) {
      const Index parent = plan_.tree.parent[t.front];
      if (parent >= 0) {
        EXPECT_NE(down[static_cast<std::size_t>(parent)], 0) << "front " << t.front;
      }
      down[static_cast<std::size_t>(t.front)] = 1;
    }
    for (std::size_t f = 0; f < up.size(); ++f) {
      EXPECT_EQ(up[f] != 0, (tables_.fronts[f].members >> d & 1) != 0);
      EXPECT_EQ(down[f] != 0, (tables_.fronts[f].members >> d & 1) != 0);
    }
  }
}

// What is sent to a device holds the values that tasks in its list assemble, and, where nobody steals, not much else.
TEST_P(CudaDevices, ValuesReachWhoAssemblesThem) {
  const Offset values = a_.nonzeros();
  const auto needed = device::cuda::needed_values(plan_, tables_, values, &pool_);
  EXPECT_EQ(needed, device::cuda::needed_values(plan_, tables_, values, nullptr)) << "on one thread";
  ASSERT_EQ(needed.size(), tables_.lists.size());
  EXPECT_TRUE(needed[0].empty()) << "the first device has all values";
  std::size_t sent = 0;
  for (std::size_t d = 1; d < needed.size(); ++d) {
    std::set<std::uint32_t> used;
    for (const FactorTask& t : tables_.lists[d].tasks)
      for (Offset e = plan_.entry_ptr[plan_.first_tile[t.front]]; e < plan_.entry_ptr[plan_.first_tile[t.front + 1]];
           ++e)
        used.insert(static_cast<std::uint32_t>(plan_.entries[e].source() / device::cuda::kValueChunk));
    EXPECT_TRUE(std::includes(needed[d].begin(), needed[d].end(), used.begin(), used.end())) << "device " << d;
    sent += needed[d].size();
  }
  if (!GetParam().stealing) {
    const std::size_t copies = (needed.size() - 1) * static_cast<std::size_t>(values);  // as if each had all
    EXPECT_LT(4 * sent * device::cuda::kValueChunk, 3 * copies) << "devices share the matrix";
  }
}

TEST(CudaDevicesStealing, SomebodySteals) {
  // Device 0 sleeps until all others are through: what it could lose is gone.
  base::ThreadPool pool{2};
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "10"}), &pool);
  device::cuda::DeviceTuning tuning;
  tuning.stealing = true;
  const auto plan = plan::make_plan(analysis::build_tree(analysis::graph_of(a, pool), {}, pool), a, {},
                                    device::cuda::cuda_plan_options(Kind::llt, tuning, 2), pool);
  const DevicePlan tables = device::cuda::make_device_plan(plan, Kind::llt);
  ASSERT_GT(tables.regions.size(), static_cast<std::size_t>(tables.first_stealable));
  bool listed = false;
  for (const FactorTask& t : tables.lists[1].tasks)
    listed = listed || (t.region >= tables.first_stealable && tables.region_device[t.region] == 0);
  EXPECT_TRUE(listed) << "device 1 can take a sub-tree of device 0";
}

// A device joins inverses in its own copy, once for each front that it solves with; not where all share one copy, and
// not in sub-trees that another device may make.
TEST_P(CudaDevices, InversesAreJoinedInCopiesOfOnesOwn) {
  for (const bool peer_access : {true, false}) {
    const DevicePlan tables = device::cuda::make_device_plan(plan_, GetParam().kind, peer_access);
    std::vector<Index> listed(tables.fronts.size(), 0);
    for (std::size_t d = 0; d < tables.lists.size(); ++d)
      for (const device::cuda::SolveTask& task : tables.lists[d].inverses) {
        const Front& f = tables.fronts[static_cast<std::size_t>(task.front)];
        EXPECT_NE(f.members >> d & 1, 0);
        EXPECT_TRUE(f.region == 0 ? peer_access : f.region < tables.first_stealable);
        ++listed[static_cast<std::size_t>(task.front)];
      }
    for (std::size_t f = 0; f < listed.size(); ++f) {
      const Front& x = tables.fronts[f];
      const bool joined = x.whole == 0 && x.inverted == device::cuda::kRowBlock;
      EXPECT_EQ(listed[f], joined ? x.pivot_blocks * std::popcount(x.members) : 0) << "front " << f;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Systems, CudaDevices,
                         ::testing::Values(Parameter{{"elasticity", "10"}, Kind::llt, 2, false},
                                           Parameter{{"elasticity", "10"}, Kind::llt, 4, true},
                                           Parameter{{"elasticity", "7"}, Kind::ldlt, 8, false},
                                           Parameter{{"gyroscopic", "7"}, Kind::lu, 3, true},
                                           Parameter{{"plate", "30", "30"}, Kind::llt, 4, true},
                                           Parameter{{"plate", "30", "30"}, Kind::llt, 3, false, false},
                                           Parameter{{"kkt", "9", "4", "3", "3"}, Kind::ldlt, 4, true},
                                           Parameter{{"kkt", "40", "3", "2", "2"}, Kind::ldlt, 16, false}),
                         [](const auto& tested) {
                           std::string name;
                           for (const auto& w : tested.param.words) name += w + "_";
                           return name + std::to_string(tested.param.devices) +
                                  (tested.param.stealing ? "_stealing" : "") +
                                  (tested.param.shared_top ? "" : "_own_top");
                         });

}  // namespace cuda_devices_test
}  // namespace espalier
