// Memory that devices reach without the staging ring. Truth: which ranges the machine was asked to pin and to release;
// the bits of the same factorization through the ring, with copies made as late as the plan allows; a copy outside of
// pinned memory throws.
#include "out_of_core/pinned_store.hpp"

#include <atomic>
#include <chrono>
#include <map>
#include <thread>

#include "out_of_core/fixture.hpp"

namespace espalier {
namespace {

using device::host::HostOutOfCoreOptions;
using out_of_core::PinnedStore;
using test::OutOfCoreSystem;
using test::same_bits;

constexpr Offset kBlock = 1024;

// Notes what is pinned.
struct Machine {
  std::map<std::byte*, Offset> pinned;
  std::atomic<int> requests = 0;
  int refuse = 0;
  bool entered = false;
  PinnedStore::Calls calls() {
    return {[this] { entered = true; },
            [this](std::byte* at, Offset bytes) {
              EXPECT_TRUE(entered);
              if (++requests == refuse) return false;
              pinned[at] = bytes;
              return true;
            },
            [this](std::byte* at) { EXPECT_EQ(pinned.erase(at), 1U) << "released, but not pinned"; }};
  }
};

// Waits until as many bytes are pinned. @returns false when that takes too long
bool wait_for(const PinnedStore& store, Offset bytes) {
  for (int k = 0; k < 2000 && store.pinned_bytes() < bytes; ++k)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return store.pinned_bytes() == bytes;
}

TEST(PinnedStore, GoesFromTheEndToTheBeginningAndReleasesAll) {
  constexpr Offset kBytes = 5 * kBlock + 100;
  std::vector<std::byte> memory(kBytes);
  Machine machine;
  {
    PinnedStore store(memory.data(), kBytes, kBytes, kBlock, machine.calls());
    EXPECT_EQ(store.pinned_bytes(), 0);
    EXPECT_FALSE(store.holds(memory.data() + kBytes - 1, 1)) << "not before start()";
    store.start();
    store.start();
    ASSERT_TRUE(wait_for(store, kBytes));
    EXPECT_TRUE(store.holds(memory.data(), kBytes));
    EXPECT_FALSE(store.holds(memory.data(), kBytes + 1));
    EXPECT_EQ(store.left_in_block(memory.data() + kBlock - 8), 8);
    ASSERT_EQ(machine.pinned.size(), 6U);
    Offset at = 0;
    for (const auto& [begin, bytes] : machine.pinned) {
      EXPECT_EQ(begin, memory.data() + at);
      at += bytes;
    }
    EXPECT_EQ(at, kBytes);
  }
  EXPECT_TRUE(machine.pinned.empty());
}

TEST(PinnedStore, CompleteWaitsAndSaysWhetherAllIsPinned) {
  constexpr Offset kBytes = 4 * kBlock;
  std::vector<std::byte> memory(kBytes);
  for (const int refuse : {0, 3}) {
    Machine machine;
    machine.refuse = refuse;
    PinnedStore store(memory.data(), kBytes, kBytes, kBlock, machine.calls());
    EXPECT_EQ(store.complete(), refuse == 0);
    EXPECT_EQ(store.complete(), refuse == 0);
    EXPECT_EQ(machine.requests, refuse == 0 ? 4 : 3) << "asked again";
  }
  Machine machine;
  PinnedStore limited(memory.data(), kBytes, kBytes - 1, kBlock, machine.calls());
  EXPECT_FALSE(limited.complete());
}

TEST(PinnedStore, TheLimitAndARefusalEndIt) {
  constexpr Offset kBytes = 6 * kBlock;
  std::vector<std::byte> memory(kBytes);
  {
    Machine machine;
    PinnedStore store(memory.data(), kBytes, 3 * kBlock + kBlock / 2, kBlock, machine.calls());
    store.start();
    ASSERT_TRUE(wait_for(store, 3 * kBlock));
    EXPECT_TRUE(store.holds(memory.data() + 3 * kBlock, 3 * kBlock));
    EXPECT_FALSE(store.holds(memory.data() + 3 * kBlock - 1, 2));
  }
  {
    Machine machine;
    machine.refuse = 3;
    PinnedStore store(memory.data(), kBytes, kBytes, kBlock, machine.calls());
    store.start();
    ASSERT_TRUE(wait_for(store, 2 * kBlock));
    for (int k = 0; k < 2000 && machine.requests < 3; ++k) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_EQ(machine.requests, 3) << "asked again after a refusal";
  }
  {
    Machine machine;
    PinnedStore store(memory.data(), kBytes, 0, kBlock, machine.calls());
    store.start();
    EXPECT_FALSE(machine.entered) << "nothing may be pinned";
  }
}

class OutOfCoreFromPinnedMemory : public test::OutOfCoreFactorization {
 protected:
  // Host devices whose direct copies are late.
  static std::vector<HostOutOfCoreOptions> late_devices(int devices, int refuse_pin = 0) {
    std::vector<HostOutOfCoreOptions> list(static_cast<std::size_t>(devices));
    for (int d = 0; d < devices; ++d) {
      HostOutOfCoreOptions& o = list[static_cast<std::size_t>(d)];
      o.device = d;
      o.devices = devices;
      o.threads = 1;
      o.late_copies = true;
      o.refuse_pin = refuse_pin;
    }
    return list;
  }
  static Offset direct_bytes(const device::Executor<double>& executor) {
    Offset sum = executor.out_of_core().direct_bytes;
    const auto work = executor.device_work();
    for (std::size_t d = 1; d < work.size(); ++d) sum += work[d].out_of_core.direct_bytes;
    return sum;
  }
  // Factors until the pinned part of the store no longer grows, and the last copies were of that part.
  device::OutOfCoreReport factorize_until_pinned(device::Executor<double>& executor) {
    Offset before = -1;
    for (int k = 0; k < 1000; ++k) {
      expect_the_same(executor.factorize(a_.values));
      const device::OutOfCoreReport r = executor.out_of_core();
      if (k > 2 && r.pinned_bytes == before) break;
      before = r.pinned_bytes;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    (void)executor.factorize(a_.values);
    return executor.out_of_core();
  }
};

TEST_P(OutOfCoreFromPinnedMemory, TheSameBitsAsThroughTheRing) {
  for (const int devices : {1, 3}) {
    const Offset budget = floor_of(late_devices(devices)) * 5 / 4;
    const std::vector<out_of_core::OutOfCoreDevice> list(static_cast<std::size_t>(devices), {budget});
    pinned_bytes_ = 0;
    auto ring = start(list, late_devices(devices));
    (void)ring->factorize(a_.values);
    const std::vector<double> x = solved(*ring, false);
    EXPECT_EQ(ring->out_of_core().pinned_bytes, 0);
    EXPECT_EQ(direct_bytes(*ring), 0);
    for (const int refuse : {0, 4}) {
      SCOPED_TRACE(std::to_string(devices) + " devices, refusal " + std::to_string(refuse));
      pinned_bytes_ = Offset{1} << 40;
      auto pinned = start(list, late_devices(devices, refuse));
      (void)pinned->factorize(a_.values);
      EXPECT_EQ(pinned->out_of_core().pinned_bytes, 0) << "who factors once does not pay";
      const auto r = factorize_until_pinned(*pinned);
      EXPECT_GT(r.store_bytes, 6 * (16 << 10)) << "the system is too small for a refusal";
      if (refuse == 0) {
        EXPECT_EQ(r.pinned_bytes, r.store_bytes);
      } else {
        EXPECT_GT(r.pinned_bytes, 0);
        EXPECT_LT(r.pinned_bytes, r.store_bytes);
      }
      EXPECT_GT(direct_bytes(*pinned), 0);
      EXPECT_TRUE(same_bits(solved(*pinned, false), x));
    }
  }
}

TEST_P(OutOfCoreFromPinnedMemory, AFailureLeavesNoCopyBehind) {
  pinned_bytes_ = Offset{1} << 40;
  PulledCable cable{0};
  cable.armed = false;
  auto options = late_devices(2);
  options[1].before_run = std::ref(cable);
  auto executor = start(std::vector<out_of_core::OutOfCoreDevice>(2, {floor_of(late_devices(2)) * 3 / 2}), options);
  (void)factorize_until_pinned(*executor);
  const std::vector<double> x = solved(*executor, false);
  for (const int after : {1, 5}) {
    cable = {after};
    expect_recovery(*executor, cable);
    EXPECT_TRUE(same_bits(solved(*executor, false), x));
  }
}

INSTANTIATE_TEST_SUITE_P(Systems, OutOfCoreFromPinnedMemory,
                         ::testing::Values(OutOfCoreSystem{{"elasticity", "8"}, Kind::llt},
                                           OutOfCoreSystem{{"elasticity", "6"}, Kind::ldlt},
                                           OutOfCoreSystem{{"gyroscopic", "6"}, Kind::lu}));

}  // namespace
}  // namespace espalier
