/// \file
/// Systems that are factored out of core, and their factorization in core to compare with.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "analysis/ordering.hpp"
#include "device/host/host_executor.hpp"
#include "device/host/out_of_core/backend.hpp"
#include "matrix/generators/generate.hpp"
#include "out_of_core/executor.hpp"
#include "parameters.hpp"
#include "plan/plan.hpp"

namespace espalier::test {

using device::FactorOutcome;
using device::host::HostOutOfCoreOptions;

inline constexpr double kTiny = 1e-14;

struct OutOfCoreSystem {
  std::vector<std::string> words;
  Kind kind;
  friend void PrintTo(const OutOfCoreSystem& p, std::ostream* out) { print(*out, p.words, p.kind); }
};

inline std::vector<OutOfCoreSystem> out_of_core_systems() {
  return {{{"elasticity", "8"}, Kind::llt},
          {{"plate", "24", "24"}, Kind::llt},
          {{"elasticity", "6"}, Kind::ldlt},
          {{"kkt", "6", "4", "3", "3"}, Kind::ldlt},
          {{"gyroscopic", "6"}, Kind::lu}};
}

class OutOfCoreFactorization : public ::testing::TestWithParam<OutOfCoreSystem> {
 protected:
  void SetUp() override {
    a_ = matrix::generate(matrix::parse_generator(GetParam().words), &pool_);
    plan::PlanOptions options;
    options.unsymmetric = GetParam().kind == Kind::lu;
    options.ldlt = GetParam().kind == Kind::ldlt;
    options.group_entries = 1 << 14;
    options.reuse_distance = 8;
    options.tiles.max_block_size = 16;  // small systems, too, shall have fronts of many tiles
    options.tiles.whole_rows = 32;
    options.range_flops = 2e4;
    plan_ = plan::make_plan(analysis::build_tree(analysis::graph_of(a_, pool_), {}, pool_), a_, {}, options, pool_);
    auto in_core = device::host::make_host_executor<double>({plan_, GetParam().kind, false, {0.01, kTiny}, pool_});
    outcome_ = in_core->factorize(a_.values);
    x_ = solved(*in_core, false);
    need_ = plan_.memory.size * static_cast<Offset>(sizeof(double));
    floor_ = floor_of({HostOutOfCoreOptions{}});
  }

  // The least budget of each of these devices, as the refusal of a tiny one says.
  Offset floor_of(const std::vector<HostOutOfCoreOptions>& devices) {
    try {
      (void)start(std::vector<out_of_core::OutOfCoreDevice>(devices.size(), {1000}), devices);
    } catch (const out_of_core::BudgetTooSmall& e) {
      EXPECT_EQ(e.status().code, StatusCode::out_of_memory);
      EXPECT_NE(std::string(e.what()).find("needs: " + std::to_string(e.needed())), std::string::npos) << e.what();
      return e.needed();
    }
    ADD_FAILURE() << "1000 bytes were enough";
    return 0;
  }

  std::unique_ptr<device::Executor<double>> start(Offset budget, HostOutOfCoreOptions options = {}) {
    return start({{budget}}, {std::move(options)});
  }
  std::unique_ptr<device::Executor<double>> start(const std::vector<out_of_core::OutOfCoreDevice>& devices,
                                                  std::vector<HostOutOfCoreOptions> options) {
    out_of_core::OutOfCoreOptions options_of_all;
    options_of_all.pinned_bytes = pinned_bytes_;
    options_of_all.pinned_block_bytes = 16 << 10;
    options_of_all.least_direct_bytes = 1;
    options_of_all.devices = devices;
    options_of_all.slot_bytes = 4096;  // copies of many pieces
    options_of_all.slots = 3;
    options_of_all.rates.share_seconds = 0;
    options_of_all.rates.resident = resident_;
    options_of_all.rates.keep_contributions = keeps_;
    options_of_all.disk = disk_;
    std::vector<std::unique_ptr<out_of_core::OutOfCoreBackend<double>>> backends;
    for (HostOutOfCoreOptions& o : options)
      backends.push_back(device::host::make_host_out_of_core_backend<double>(
          {plan_, GetParam().kind, false, {0.01, kTiny}, pool_}, std::move(o)));
    return out_of_core::make_out_of_core_executor<double>(std::move(backends), options_of_all, nullptr);
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

  // Largest difference of x to the truth, of the truth's largest entry.
  static double difference(const std::vector<double>& x, const std::vector<double>& truth) {
    double most = 0, size = 0;
    for (std::size_t k = 0; k < x.size(); ++k) {
      most = std::max(most, std::abs(x[k] - truth[k]));
      size = std::max(size, std::abs(truth[k]));
    }
    return most / size;
  }
  // To the answer in core.
  [[nodiscard]] double difference(const std::vector<double>& x) const { return difference(x, x_); }
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

  // Fails one operation of a device, until it is mended.
  struct PulledCable {
    int after;  // operations
    int runs = 0;
    bool armed = true;
    void operator()(const out_of_core::Operation&) {
      if (armed && runs++ == after) throw Error(StatusCode::device_error, "the cable was pulled");
    }
  };
  // The failure ends a factorization, and the next one works.
  void expect_recovery(device::Executor<double>& executor, PulledCable& cable) {
    try {
      (void)executor.factorize(a_.values);
      EXPECT_LE(cable.runs, cable.after) << "a failure went unnoticed";
    } catch (const Error& e) {
      EXPECT_NE(std::string(e.what()).find("cable"), std::string::npos);
    }
    cable.armed = false;
    expect_the_same(executor.factorize(a_.values));
    EXPECT_LE(difference(solved(executor, false)), tolerance());
  }

  // Eight right-hand sides of the transposed system, against the executor in core.
  void expect_transposed_as_in_core(device::Executor<double>& executor) {
    (void)executor.factorize(a_.values);
    auto in_core = device::host::make_host_executor<double>({plan_, GetParam().kind, false, {0.01, kTiny}, pool_});
    (void)in_core->factorize(a_.values);
    const Index columns = 8;
    std::vector<double> x(static_cast<std::size_t>(a_.cols) * columns);
    for (std::size_t k = 0; k < x.size(); ++k) x[k] = std::sin(static_cast<double>(k));
    std::vector<double> y = x;
    executor.solve(x.data(), columns, true);
    in_core->solve(y.data(), columns, true);
    EXPECT_LE(difference(x, y), tolerance());
  }

  base::ThreadPool pool_{2};
  SparseMatrix a_;
  plan::Plan plan_;
  FactorOutcome outcome_;
  std::vector<double> x_;
  Offset need_ = 0;          // bytes in core
  Offset floor_ = 0;         // bytes of the least budget
  Offset pinned_bytes_ = 0;  // of the store may be page-locked
  out_of_core::DiskOptions disk_;
  bool keeps_ = false;    // runs may make a part
  double resident_ = -1;  // of the budget: factors that stay on the device
};

inline bool same_bits(const std::vector<double>& x, const std::vector<double>& y) {
  return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
}

}  // namespace espalier::test
