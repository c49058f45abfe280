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
    EXPECT_GE(report.bytes_out, static_cast<Offset>(sizeof(double)) * plan_.nonzeros_factor);
    // Again: the same bits.
    (void)executor->factorize(a_.values);
    EXPECT_TRUE(same_bits(solved(*executor, false), x));
  }
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
