// Several devices out of core: 2 to 8 host devices with budgets of their own. Truth: the factorization in core (answers
// to rounding, inertia and counts exactly), the bits of another run whatever is late, the budgets, and a player that
// lets the queues of all devices go on in any order.
#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <thread>

#include "out_of_core/fixture.hpp"
#include "out_of_core/share.hpp"

namespace espalier {
namespace {

using device::host::HostOutOfCoreOptions;
using out_of_core::Operation;
using out_of_core::OutOfCoreDevice;
using out_of_core::OutOfCorePlan;
using test::OutOfCoreSystem;
using test::same_bits;

class OutOfCoreDevices : public test::OutOfCoreFactorization {
 protected:
  static std::vector<HostOutOfCoreOptions> host_devices(int devices) {
    std::vector<HostOutOfCoreOptions> list(static_cast<std::size_t>(devices));
    for (int d = 0; d < devices; ++d) {
      list[static_cast<std::size_t>(d)].device = d;
      list[static_cast<std::size_t>(d)].devices = devices;
      list[static_cast<std::size_t>(d)].threads = 1;
    }
    return list;
  }
  // The floor of several devices; a device may need more than all of it on one.
  Offset floor_on(int devices) { return floor_of(host_devices(devices)); }
  // Budgets between the floor and what the factorization needs in core.
  static std::vector<OutOfCoreDevice> budgets(int devices, Offset floor, Offset need, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> part(0, 1);
    std::vector<OutOfCoreDevice> list;
    for (int d = 0; d < devices; ++d) {
      const double x = part(random);
      list.push_back({floor + static_cast<Offset>(x * x * x * static_cast<double>(std::max<Offset>(0, need - floor))),
                      0.25 + 2 * part(random)});
    }
    return list;
  }
};

TEST_P(OutOfCoreDevices, AnyBudgetsGiveTheAnswerInCore) {
  Index shared = 0;
  for (const int devices : {2, 3, 8}) {
    const Offset floor = floor_on(devices);
    for (std::uint64_t seed = 0; seed < (devices == 8 ? 1U : 2U); ++seed) {
      SCOPED_TRACE(std::to_string(devices) + " devices, seed " + std::to_string(seed));
      const auto list = seed == 0 ? std::vector<OutOfCoreDevice>(static_cast<std::size_t>(devices), {floor})
                                  : budgets(devices, floor, need_, seed);
      auto executor = start(list, host_devices(devices));
      expect_the_same(executor->factorize(a_.values));
      const std::vector<double> x = solved(*executor, false);
      EXPECT_LE(difference(x), tolerance());
      const auto work = executor->device_work();
      ASSERT_EQ(work.size(), list.size());
      Offset stored = 0;
      for (std::size_t d = 0; d < list.size(); ++d) {
        EXPECT_LE(work[d].peak_bytes, list[d].budget_bytes);
        EXPECT_EQ(work[d].peak_bytes, work[d].out_of_core.predicted_bytes);
        stored += work[d].out_of_core.bytes_out;
      }
      shared += std::count_if(work.begin(), work.end(), [](const auto& w) { return w.out_of_core.groups > 0; }) > 1;
      EXPECT_GE(stored, static_cast<Offset>(sizeof(double)) * plan_.nonzeros_factor);
      (void)executor->factorize(a_.values);
      EXPECT_TRUE(same_bits(solved(*executor, false), x));
    }
  }
  EXPECT_GT(shared, 0) << "no front was shared: the budgets test little";
}

TEST_P(OutOfCoreDevices, DelaysDoNotChangeTheBits) {
  constexpr int kDevices = 4;
  const auto list = budgets(kDevices, floor_on(kDevices), need_ / 2, 11);
  auto calm = start(list, host_devices(kDevices));
  (void)calm->factorize(a_.values);
  const std::vector<double> x = solved(*calm, false);
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    auto options = host_devices(kDevices);
    std::vector<std::mt19937_64> random;
    for (std::uint64_t d = 0; d < kDevices; ++d) random.emplace_back(100 * seed + d);
    for (std::size_t d = 0; d < options.size(); ++d)
      options[d].before_run = [&, d](const Operation&) {
        const unsigned often = d == seed ? 1 : 8;  // one of them is always late
        if (random[d]() % often == 0) std::this_thread::sleep_for(std::chrono::microseconds(random[d]() % 300));
      };
    auto late = start(list, std::move(options));
    (void)late->factorize(a_.values);
    EXPECT_TRUE(same_bits(solved(*late, false), x)) << "seed " << seed;
  }
}

TEST_P(OutOfCoreDevices, ADeviceThatFailsEndsTheRunAndTheNextOneWorks) {
  constexpr int kDevices = 3;
  const auto list = budgets(kDevices, floor_on(kDevices), need_ / 2, 3);
  for (std::size_t broken = 0; broken < kDevices; ++broken) {
    PulledCable cable{2};
    auto options = host_devices(kDevices);
    options[broken].before_run = std::ref(cable);
    expect_recovery(*start(list, std::move(options)), cable);
  }
}

TEST_P(OutOfCoreDevices, TransposedAndManyRightHandSides) {
  constexpr int kDevices = 3;
  expect_transposed_as_in_core(*start(budgets(kDevices, floor_on(kDevices), need_ / 2, 5), host_devices(kDevices)));
}

// Plays the plans: every queue may do its next operation as soon as what it waits for is done.
TEST_P(OutOfCoreDevices, NoOrderOfTheQueuesDeadlocks) {
  constexpr int kDevices = 4;
  const auto layout =
      device::host::make_host_out_of_core_backend<double>({plan_, GetParam().kind, false, {0.01, test::kTiny}, pool_});
  out_of_core::PlanningRates rates;
  rates.share_seconds = 0;
  const auto plans =
      out_of_core::plan_out_of_core(*layout, budgets(kDevices, floor_on(kDevices), need_ / 2, 17), rates);
  using Queue = std::pair<std::size_t, std::size_t>;  // device, queue
  std::map<Queue, std::vector<const Operation*>> queues;
  std::size_t open = 0, crossing = 0;
  for (std::size_t d = 0; d < plans.size(); ++d)
    for (const Operation& op : plans[d].ops) {
      queues[{d, static_cast<std::size_t>(op.queue)}].push_back(&op);
      crossing += op.others.size();
      ++open;
    }
  EXPECT_GT(crossing, 0U) << "no device waits for another: this tests little";
  std::map<Queue, std::size_t> done;
  std::mt19937 random(23);
  const auto ready = [&](const Queue& q) {
    const auto at = done[q];
    if (at == queues[q].size()) return false;
    const Operation& op = *queues[q][at];
    for (std::size_t k = 0; k < op.waits.size(); ++k)
      if (k != q.second && static_cast<std::int64_t>(done[{q.first, k}]) < op.waits[k]) return false;
    return std::all_of(op.others.begin(), op.others.end(), [&](const out_of_core::QueueWait& w) {
      const Queue other{static_cast<std::size_t>(w.device), static_cast<std::size_t>(w.queue)};
      return static_cast<std::int64_t>(done[other]) >= w.number;
    });
  };
  while (open > 0) {
    std::vector<Queue> can;
    for (const auto& [q, list] : queues)
      if (ready(q)) can.push_back(q);
    ASSERT_FALSE(can.empty()) << open << " operations are left, and none can go on";
    const Queue q = can[random() % can.size()];
    for (std::size_t burst = 1 + random() % 64; burst > 0 && ready(q); --burst, --open) ++done[q];
  }
}

TEST_P(OutOfCoreDevices, SetsFollowTheTree) {
  for (const int devices : {1, 2, 5, 64}) {
    const auto sets = out_of_core::share_fronts(plan_, std::vector<double>(static_cast<std::size_t>(devices), 1));
    std::uint64_t used = 0;
    for (Index f = 0; f < plan_.fronts(); ++f) {
      ASSERT_NE(sets[f], 0U);
      used |= sets[f];
      if (const Index p = plan_.tree.parent[f]; p >= 0) {
        ASSERT_EQ(sets[f] & ~sets[p], 0U) << "a front has a device that its parent lacks";
      }
    }
    EXPECT_EQ(used, devices == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << devices) - 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Systems, OutOfCoreDevices, ::testing::ValuesIn(test::out_of_core_systems()));

}  // namespace
}  // namespace espalier
