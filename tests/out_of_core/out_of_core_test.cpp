// Factorization in less memory than the factor needs, on a host device. Truth: the factorization in core (answers to
// rounding, inertia and counts exactly), the independent residual, the bits of another run, and the budget itself.
#include <chrono>
#include <functional>
#include <thread>

#include "out_of_core/fixture.hpp"

namespace espalier {
namespace {

using device::host::HostOutOfCoreOptions;
using out_of_core::Operation;
using test::OutOfCoreSystem;
using test::same_bits;

class OutOfCoreSystems : public test::OutOfCoreFactorization {};

TEST_P(OutOfCoreSystems, AnyBudgetGivesTheAnswerInCore) {
  ASSERT_LT(floor_, need_ / 3) << "the budgets would test little";
  std::mt19937_64 random(7);
  std::vector<Offset> budgets{floor_, need_, need_ / 2};
  std::uniform_real_distribution<double> part(0, 1);
  for (int k = 0; k < 3; ++k)
    budgets.push_back(floor_ + static_cast<Offset>(std::pow(part(random), 3) * static_cast<double>(need_ - floor_)));
  for (const Offset budget : budgets) {
    SCOPED_TRACE("budget " + std::to_string(budget) + ", in core " + std::to_string(need_));
    auto executor = start(budget);
    expect_the_same(executor->factorize(a_.values));
    const std::vector<double> x = solved(*executor, false);
    EXPECT_LE(difference(x), tolerance());
    const auto report = executor->out_of_core();
    EXPECT_LE(executor->peak_bytes(), budget);
    EXPECT_EQ(executor->peak_bytes(), report.predicted_bytes);
    if (budget == floor_) {
      EXPECT_GT(report.groups, 1) << "no front was too large: the budget tests little";
    }
    EXPECT_GT(report.groups + report.steps, 1);
    EXPECT_GE(report.bytes_out + executor->peak_bytes(),
              static_cast<Offset>(sizeof(double)) * plan_.nonzeros_factor);  // what does not go out stays
    // Again: the same bits.
    (void)executor->factorize(a_.values);
    EXPECT_TRUE(same_bits(solved(*executor, false), x));
  }
}

// What stays is all above something, and what streams are whole sub-trees below it; none of it has a place in the
// store, or all of it.
TEST_P(OutOfCoreSystems, ResidentFactorsAreTheTopOfTheTree) {
  base::ThreadPool& pool = pool_;
  const auto backend =
      device::host::make_host_out_of_core_backend<double>({plan_, GetParam().kind, false, {0.01, test::kTiny}, pool});
  int with_residents = 0, with_streamed = 0;
  for (const double share : {0.1, 0.3, 0.5}) {
    out_of_core::PlanningRates rates;
    rates.resident = share;
    const Offset budget = floor_ + (need_ - floor_) * 2 / 3;
    const out_of_core::OutOfCorePlan p = out_of_core::plan_out_of_core(*backend, {{budget, 1}}, rates).front();
    EXPECT_LE(p.arena_bytes, budget);
    const auto by_all = out_of_core::plan_out_of_core(*backend, {{budget, 1}}, rates, &pool);
    EXPECT_EQ(by_all.front().resident_at, p.resident_at) << "threads change the plan";
    EXPECT_EQ(by_all.front().predicted_seconds, p.predicted_seconds);
    with_residents += p.resident.empty() ? 0 : 1;
    with_streamed += p.streamed.empty() ? 0 : 1;
    std::vector<char> where(static_cast<std::size_t>(plan_.fronts()), 'h');
    for (const Index f : p.resident) where[f] = 'r';
    for (const Index f : p.streamed) {
      EXPECT_EQ(where[f], 'h') << f;
      where[f] = 's';
    }
    for (Index f = 0; f < plan_.fronts(); ++f) {
      const Index parent = plan_.tree.parent[f];
      const char above = parent < 0 ? 'r' : where[parent];
      EXPECT_EQ(p.resident_at[f][0] >= 0, where[f] == 'r') << f;
      EXPECT_EQ(p.factor_store[f] < 0, where[f] == 'r') << f;
      if (where[f] == 'r') {
        EXPECT_EQ(above, 'r') << f;
      }
      if (where[f] == 's') {
        EXPECT_TRUE(above == 'r' || above == 's') << f;
      }
      if (above == 's') {
        EXPECT_EQ(where[f], 's') << f;
      }
    }
  }
  EXPECT_GT(with_residents, 0);
  if (GetParam().words.front() == "elasticity" && GetParam().kind == Kind::llt) {
    EXPECT_GT(with_streamed, 0);
  }
}

// The same answers with factors in both memories, the same bits in every run, and a smaller store.
TEST_P(OutOfCoreSystems, FactorsThatStayGiveTheAnswerInCore) {
  resident_ = 0;
  const Offset budget = floor_ + (need_ - floor_) * 2 / 3;
  auto none = start(budget);
  (void)none->factorize(a_.values);
  int smaller = 0;
  for (const Offset pinned : {Offset{0}, Offset{1} << 40})
    for (const double share : {0.15, 0.3, 0.5}) {
      SCOPED_TRACE("share " + std::to_string(share) + ", pinned " + std::to_string(pinned));
      resident_ = share;
      pinned_bytes_ = pinned;
      auto executor = start(budget);
      expect_the_same(executor->factorize(a_.values));
      EXPECT_LE(executor->peak_bytes(), budget);
      smaller += executor->out_of_core().store_bytes < none->out_of_core().store_bytes * 9 / 10 ? 1 : 0;
      const std::vector<double> x = solved(*executor, false);
      EXPECT_LE(difference(x), tolerance());
      (void)executor->factorize(a_.values);
      EXPECT_TRUE(same_bits(solved(*executor, false), x));
      EXPECT_TRUE(same_bits(solved(*executor, false), x)) << "the solve changed the factor";
      expect_transposed_as_in_core(*executor);
    }
  EXPECT_GT(smaller, 0) << "nothing stayed: the shares test little";
}

TEST_P(OutOfCoreSystems, DelaysDoNotChangeTheBits) {
  const Offset budget = floor_ + (need_ - floor_) / 8;
  auto calm = start(budget);
  (void)calm->factorize(a_.values);
  const std::vector<double> x = solved(*calm, false);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    std::mt19937_64 random(seed);
    HostOutOfCoreOptions options;
    options.before_run = [&](const Operation&) {
      if (random() % 4 == 0) std::this_thread::sleep_for(std::chrono::microseconds(random() % 500));
    };
    auto late = start(budget, options);
    (void)late->factorize(a_.values);
    EXPECT_TRUE(same_bits(solved(*late, false), x));
  }
}

TEST_P(OutOfCoreSystems, AFailureEndsTheRunAndTheNextOneWorks) {
  for (const int after : {0, 3, 11}) {
    PulledCable cable{after};
    HostOutOfCoreOptions options;
    options.before_run = std::ref(cable);
    expect_recovery(*start(floor_ + (need_ - floor_) / 8, options), cable);
  }
}

TEST_P(OutOfCoreSystems, TransposedAndManyRightHandSides) {
  expect_transposed_as_in_core(*start(floor_ + (need_ - floor_) / 5));
}

TEST_P(OutOfCoreSystems, TheFloorIsTheFloor) {
  EXPECT_NO_THROW((void)start(floor_));
  try {
    (void)start(floor_ / 2);
    ADD_FAILURE() << "half of the floor was accepted";
  } catch (const Error& e) {
    EXPECT_EQ(e.status().code, StatusCode::out_of_memory);
    EXPECT_NE(std::string(e.what()).find(std::to_string(floor_ / 2) + " bytes"), std::string::npos) << e.what();
  }
}

INSTANTIATE_TEST_SUITE_P(Systems, OutOfCoreSystems, ::testing::ValuesIn(test::out_of_core_systems()));

}  // namespace
}  // namespace espalier
