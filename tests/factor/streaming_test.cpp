// Factorization in less memory than the factor needs, on a host device. Truth: the factorization in core (answers to
// rounding, inertia and counts exactly), the independent residual, the bits of another run, and the budget itself.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "analysis/ordering.hpp"
#include "analysis/plan.hpp"
#include "device/host/host_executor.hpp"
#include "device/host/host_stream.hpp"
#include "factor/streaming_executor.hpp"
#include "matrix/generators/generate.hpp"

namespace espalier {
namespace {

using analysis::StreamOp;
using device::FactorOutcome;
using device::host::HostStreamOptions;

constexpr double kTiny = 1e-14;

struct System {
  std::vector<std::string> words;
  Kind kind;
};

class Streaming : public ::testing::TestWithParam<System> {
 protected:
  void SetUp() override {
    a_ = matrix::generate(matrix::parse_generator(GetParam().words), &pool_);
    analysis::PlanOptions options;
    options.unsymmetric = GetParam().kind == Kind::lu;
    options.ldlt = GetParam().kind == Kind::ldlt;
    options.group_entries = 1 << 14;
    options.reuse_distance = 8;
    options.tiles.max_block_size = 16;  // small systems, too, shall have fronts of many tiles
    options.tiles.whole_rows = 32;
    options.range_flops = 2e4;
    plan_ = analysis::make_plan(analysis::build_tree(analysis::graph_of(a_, pool_), {}, pool_), a_, {}, options, pool_);
    auto in_core =
        device::host::make_host_executor<double>(plan_, GetParam().kind, {0.01, kTiny}, pool_, nullptr, nullptr);
    outcome_ = in_core->factorize(a_.values);
    x_ = solved(*in_core, false);
    need_ = plan_.memory.size * static_cast<Offset>(sizeof(double));
    try {
      (void)start(1000);
      ADD_FAILURE() << "1000 bytes were enough";
    } catch (const Error& e) {
      EXPECT_EQ(e.status().code, StatusCode::out_of_memory);
      const std::string text = e.what(), mark = "streaming needs: ";
      floor_ = std::stoll(text.substr(text.find(mark) + mark.size()));
    }
  }

  std::unique_ptr<device::Executor<double>> start(Offset budget, HostStreamOptions options = {}) {
    factor::StreamingOptions streaming;
    streaming.budget_bytes = budget;
    streaming.slot_bytes = 4096;  // copies of many pieces
    streaming.slots = 3;
    return factor::make_streaming_executor<double>(
        device::host::make_host_stream<double>(plan_, GetParam().kind, {0.01, kTiny}, pool_, nullptr,
                                               std::move(options)),
        streaming, nullptr);
  }

  [[nodiscard]] std::vector<double> rhs() const {
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::vector<double> b(static_cast<std::size_t>(a_.cols));
    for (double& v : b) v = uniform(random);
    return b;
  }
  std::vector<double> solved(device::Executor<double>& executor, bool transpose) {
    std::vector<double> x = rhs();
    executor.solve(x.data(), 1, transpose);
    return x;
  }

  // Largest difference to the answer in core, of the largest entry.
  [[nodiscard]] double difference(const std::vector<double>& x) const {
    double most = 0, size = 0;
    for (std::size_t k = 0; k < x.size(); ++k) {
      most = std::max(most, std::abs(x[k] - x_[k]));
      size = std::max(size, std::abs(x_[k]));
    }
    return most / size;
  }
  // The systems' condition numbers are below 1e6 (scaled or small ones).
  [[nodiscard]] double tolerance() const {
    return 1e6 * std::numeric_limits<double>::epsilon() * std::sqrt(static_cast<double>(a_.cols));
  }

  void expect_the_same(const FactorOutcome& o) const {
    EXPECT_EQ(o.not_positive, outcome_.not_positive);
    EXPECT_EQ(o.negative, outcome_.negative);
    EXPECT_EQ(o.replaced, outcome_.replaced);
    EXPECT_NEAR(o.determinant_log, outcome_.determinant_log, 1e-10 * (1 + std::abs(outcome_.determinant_log)));
    EXPECT_EQ(o.determinant_sign, outcome_.determinant_sign);
  }

  base::ThreadPool pool_{2};
  SparseMatrix a_;
  analysis::Plan plan_;
  FactorOutcome outcome_;
  std::vector<double> x_;
  Offset need_ = 0;   // bytes in core
  Offset floor_ = 0;  // bytes of the least budget
};

bool same_bits(const std::vector<double>& x, const std::vector<double>& y) {
  return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
}

TEST_P(Streaming, AnyBudgetGivesTheAnswerInCore) {
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
    const auto report = executor->streaming();
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

TEST_P(Streaming, DelaysDoNotChangeTheBits) {
  const Offset budget = floor_ + (need_ - floor_) / 8;
  auto calm = start(budget);
  (void)calm->factorize(a_.values);
  const std::vector<double> x = solved(*calm, false);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    std::mt19937_64 random(seed);
    HostStreamOptions options;
    options.before_run = [&](const StreamOp&) {
      if (random() % 4 == 0) std::this_thread::sleep_for(std::chrono::microseconds(random() % 500));
    };
    auto late = start(budget, options);
    (void)late->factorize(a_.values);
    EXPECT_TRUE(same_bits(solved(*late, false), x));
  }
}

TEST_P(Streaming, AFailureEndsTheRunAndTheNextOneWorks) {
  const Offset budget = floor_ + (need_ - floor_) / 8;
  for (const int after : {0, 3, 11}) {
    int runs = 0;
    bool armed = true;
    HostStreamOptions options;
    options.before_run = [&](const StreamOp&) {
      if (armed && runs++ == after) throw Error(StatusCode::device_error, "the cable was pulled");
    };
    auto executor = start(budget, options);
    try {
      (void)executor->factorize(a_.values);
      EXPECT_LE(runs, after) << "a failure went unnoticed";
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("cable"), std::string::npos);
    }
    armed = false;
    expect_the_same(executor->factorize(a_.values));
    EXPECT_LE(difference(solved(*executor, false)), tolerance());
  }
}

TEST_P(Streaming, TransposedAndManyRightHandSides) {
  auto executor = start(floor_ + (need_ - floor_) / 5);
  (void)executor->factorize(a_.values);
  auto in_core =
      device::host::make_host_executor<double>(plan_, GetParam().kind, {0.01, kTiny}, pool_, nullptr, nullptr);
  (void)in_core->factorize(a_.values);
  const Index columns = 8;
  std::vector<double> x(static_cast<std::size_t>(a_.cols) * columns);
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = std::sin(static_cast<double>(k));
  std::vector<double> y = x;
  executor->solve(x.data(), columns, true);
  in_core->solve(y.data(), columns, true);
  double most = 0, size = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    most = std::max(most, std::abs(x[k] - y[k]));
    size = std::max(size, std::abs(y[k]));
  }
  EXPECT_LE(most, tolerance() * size);
}

TEST_P(Streaming, TheFloorIsTheFloor) {
  EXPECT_NO_THROW((void)start(floor_));
  try {
    (void)start(floor_ / 2);
    ADD_FAILURE() << "half of the floor was accepted";
  } catch (const Error& e) {
    EXPECT_EQ(e.status().code, StatusCode::out_of_memory);
    EXPECT_NE(std::string(e.what()).find(std::to_string(floor_ / 2) + " bytes"), std::string::npos) << e.what();
  }
}

INSTANTIATE_TEST_SUITE_P(Systems, Streaming,
                         ::testing::Values(System{{"elasticity", "8"}, Kind::llt},
                                           System{{"plate", "24", "24"}, Kind::llt},
                                           System{{"elasticity", "6"}, Kind::ldlt},
                                           System{{"kkt", "6", "4", "3", "3"}, Kind::ldlt},
                                           System{{"gyroscopic", "6"}, Kind::lu}));

}  // namespace
}  // namespace espalier
