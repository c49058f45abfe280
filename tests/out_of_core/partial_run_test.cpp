// Out of core, runs that make some units again. Truth: the bits of a run of the same plan that makes everything; what
// operations of the plan read, which must have been made or brought.
#include "out_of_core/partial_run.hpp"

#include <random>

#include "out_of_core/disk_folder.hpp"
#include "out_of_core/fixture.hpp"

namespace espalier {
namespace partial_run_test {

using device::FactorOutcome;
using device::host::HostOutOfCoreOptions;
using test::DiskFault;
using test::DiskFolder;
using test::kDiskBlock;
using test::same_bits;
using test::status_of;

class OutOfCorePartialRun : public test::OutOfCoreFactorization {
 protected:
  void SetUp() override {
    test::OutOfCoreFactorization::SetUp();
    keeps_ = true;
  }
  std::unique_ptr<device::Executor<double>> start_kept(Offset budget, Offset window,
                                                       HostOutOfCoreOptions options = {}) {
    if (window > 0) disk_ = {folder_.path(), window, 4 * kDiskBlock};
    auto executor = start(budget, std::move(options));
    disk_ = {};
    return executor;
  }
  [[nodiscard]] Offset least_window() const {
    Offset most = 0;
    for (Index f = 0; f < plan_.fronts(); ++f) most = std::max(most, plan_.layout[f].factor_size());
    return most * static_cast<Offset>(sizeof(double)) + 24 * kDiskBlock;
  }
  static std::vector<HostOutOfCoreOptions> several(int count) {
    std::vector<HostOutOfCoreOptions> options(static_cast<std::size_t>(count));
    for (int d = 0; d < count; ++d) {
      options[static_cast<std::size_t>(d)].device = d;
      options[static_cast<std::size_t>(d)].devices = count;
      options[static_cast<std::size_t>(d)].threads = 1 + d % 2;
    }
    return options;
  }
  // Some neighbours in the order of the values, few of them at most times.
  std::vector<double> changed(std::vector<double> values) {
    const auto below = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random_); };
    const std::size_t count = below(5) == 0 ? values.size() / 3 : below(12), first = below(values.size() - count);
    for (std::size_t k = first; k < first + count; ++k) values[k] *= 1 + 1e-3 * static_cast<double>(below(9));
    return values;
  }
  void expect_whole(device::Executor<double>& partial, device::Executor<double>& whole, const FactorOutcome& p,
                    const std::vector<double>& values) {
    const FactorOutcome w = whole.factorize(values);
    EXPECT_EQ(p.negative, w.negative);
    EXPECT_EQ(p.two_by_two, w.two_by_two);
    EXPECT_EQ(p.not_positive, w.not_positive);
    EXPECT_EQ(p.replaced, w.replaced);
    EXPECT_EQ(p.small, w.small);
    if (w.not_positive >= 0) return;  // no factor, and no determinant
    EXPECT_EQ(p.determinant_log, w.determinant_log);
    for (const bool transpose : {false, true})
      EXPECT_TRUE(same_bits(solved(partial, transpose), solved(whole, transpose))) << "share " << p.share;
  }

  std::mt19937_64 random_{17};
  DiskFolder folder_;
};

TEST_P(OutOfCorePartialRun, HasTheBitsOfAWholeOne) {
  int some = 0;
  for (const Offset budget : {floor_, floor_ + floor_ / 3, need_ / 2})
    for (const Offset window : {Offset{0}, 2 * least_window()}) {
      SCOPED_TRACE("budget " + std::to_string(budget) + ", window " + std::to_string(window));
      if (window > 0 && budget == floor_) continue;  // the other tests have it
      pinned_bytes_ = window > 0 ? 0 : 2 * need_;    // more and more of the store is pinned, from the second run on
      auto partial = start_kept(budget, window), whole = start_kept(budget, 0);
      std::vector<double> values = a_.values;
      expect_whole(*partial, *whole, partial->factorize(values), values);
      for (int k = 0; k < (window > 0 ? 4 : 12) && !HasFailure(); ++k) {
        const std::vector<double> next = changed(values);
        const FactorOutcome p = partial->factorize_changed(next, values);
        EXPECT_GE(p.share, 0);
        some += p.share > 0 && p.share < 1 ? 1 : 0;
        EXPECT_EQ(p.share == 0, next == values);
        values = next;
        expect_whole(*partial, *whole, p, values);
      }
      const FactorOutcome none = partial->factorize_changed(values, values);
      EXPECT_EQ(none.share, 0);
      expect_whole(*partial, *whole, none, values);
    }
  EXPECT_GT(some, 0);
}

// Several devices: the groups of a large front lie between each other's.
TEST_P(OutOfCorePartialRun, OnSeveralDevicesHasTheBitsOfAWholeOne) {
  int some = 0;
  for (const int count : {2, 3}) {
    const std::vector<HostOutOfCoreOptions> options = several(count);
    const Offset least = floor_of(options);
    for (const Offset window : {Offset{0}, 3 * least_window()}) {
      SCOPED_TRACE(std::to_string(count) + " devices, window " + std::to_string(window));
      std::vector<out_of_core::OutOfCoreDevice> devices;
      for (int d = 0; d < count; ++d) devices.push_back({least + d * least / 3, 1.0 / (1 + d)});
      if (window > 0) disk_ = {folder_.path(), window, 4 * kDiskBlock};
      auto partial = start(devices, options);
      disk_ = {};
      auto whole = start(devices, options);
      std::vector<double> values = a_.values;
      expect_whole(*partial, *whole, partial->factorize(values), values);
      for (int k = 0; k < (window > 0 ? 2 : 5) && !HasFailure(); ++k) {
        const std::vector<double> next = changed(values);
        const FactorOutcome p = partial->factorize_changed(next, values);
        some += p.share > 0 && p.share < 1 ? 1 : 0;
        EXPECT_EQ(p.share == 0, next == values);
        values = next;
        expect_whole(*partial, *whole, p, values);
      }
    }
  }
  EXPECT_GT(some, 0);
}

// Whatever the plan keeps in core: a step is made whole, and stores what leaves it.
TEST_P(OutOfCorePartialRun, StoresNoContributionsInsideSteps) {
  const Offset bytes = start_kept(need_ / 2, 0)->out_of_core().store_bytes;
  EXPECT_GT(bytes, 0);
  plan_.options.keep_contributions = true;
  EXPECT_EQ(start_kept(need_ / 2, 0)->out_of_core().store_bytes, bytes);
}

// What is not made neither crosses the link nor goes to the disk.
TEST_P(OutOfCorePartialRun, WritesWhatItMakes) {
  auto executor = start_kept(floor_ + floor_ / 3, least_window());
  (void)executor->factorize(a_.values);
  const Offset all = executor->out_of_core().disk_written_bytes;
  (void)executor->factorize_changed(a_.values, a_.values);
  // What the first run had still in memory may be on its way yet, where the machine is busy.
  EXPECT_LE(executor->out_of_core().disk_written_bytes, std::min(least_window(), all / 4));
  EXPECT_EQ(executor->out_of_core().disk_read_bytes, 0);
  std::vector<double> values = a_.values;
  values.front() *= 1.01;
  const double share = executor->factorize_changed(values, a_.values).share;
  EXPECT_LT(static_cast<double>(executor->out_of_core().disk_written_bytes),
            static_cast<double>(all) * (share < 0.7 ? 1 : 1.2));
}

// A run that ends in the middle leaves nothing to go on from.
TEST_P(OutOfCorePartialRun, AfterAFailureEverythingIsMade) {
  auto whole = start_kept(floor_ + floor_ / 3, 0);
  for (int after = 0; after < 200; after = 5 * after + 3) {
    PulledCable cable{after};
    cable.armed = false;
    HostOutOfCoreOptions options;
    options.before_run = std::ref(cable);
    auto executor = start_kept(floor_ + floor_ / 3, least_window(), options);
    (void)executor->factorize(a_.values);
    cable.armed = true;
    std::vector<double> values = a_.values;
    values.front() *= 1.5;
    const Status s = status_of([&] { (void)executor->factorize_changed(values, a_.values); });
    cable.armed = false;
    if (s.ok()) break;
    values.back() *= 1.5;
    const FactorOutcome next = executor->factorize_changed(values, a_.values);
    EXPECT_EQ(next.share, 1);
    expect_whole(*executor, *whole, next, values);
  }
}

// One of two, which the other one waits for.
TEST_P(OutOfCorePartialRun, AfterOneOfTwoDevicesHasFailedEverythingIsMade) {
  std::vector<HostOutOfCoreOptions> options = several(2);
  const Offset least = floor_of(options);
  auto whole = start({{least + least / 3}, {least}}, options);
  int failed = 0;
  for (int after = 0; after < 100; after = 6 * after + 1) {
    PulledCable cable{after};
    cable.armed = false;
    options[1].before_run = std::ref(cable);
    auto executor = start({{least + least / 3}, {least}}, options);
    std::vector<double> values = a_.values;
    (void)executor->factorize(values);
    cable.armed = true;
    values.back() *= 1.5;
    values.front() *= 1.5;
    const Status s = status_of([&] { (void)executor->factorize_changed(values, a_.values); });
    cable.armed = false;
    if (s.ok()) break;
    ++failed;
    EXPECT_TRUE(test::says(s, "cable")) << s.message;
    const FactorOutcome next = executor->factorize_changed(values, values);
    EXPECT_EQ(next.share, 1);
    expect_whole(*executor, *whole, next, values);
  }
  EXPECT_GT(failed, 0);
}

// Writes and reads are refused, one in each run, until none is left to be refused.
TEST_P(OutOfCorePartialRun, RefusedCallsAreErrorsAndTheNextFactorizationWorks) {
  auto whole = start_kept(floor_ + floor_ / 3, 0), executor = start_kept(floor_ + floor_ / 3, least_window());
  std::vector<double> values = a_.values;
  (void)executor->factorize(values);
  for (const char* call : {"write", "read"})
    for (int number = 1; number < 2000; number *= 6) {
      std::vector<double> next = values;
      next.front() *= 1.25;
      int calls = 0;
      FactorOutcome outcome;
      const Status s = status_of([&] {
        DiskFault fault(call, number, std::string(call) == "write" ? ENOSPC : EIO);
        try {
          outcome = executor->factorize_changed(next, values);
        } catch (...) {
          calls = fault.calls();
          throw;
        }
        calls = fault.calls();
      });
      if (!s.ok()) {
        EXPECT_TRUE(test::says(s, folder_.path()) && test::says(s, "--scratch")) << s.message;
        outcome = executor->factorize_changed(next, values);
        EXPECT_EQ(outcome.share, 1) << "what a stopped run has left is no factor";
      }
      values = next;
      expect_whole(*executor, *whole, outcome, values);
      if (calls < number) break;
    }
}

INSTANTIATE_TEST_SUITE_P(Systems, OutOfCorePartialRun, ::testing::ValuesIn(test::out_of_core_systems()));

}  // namespace partial_run_test
}  // namespace espalier
