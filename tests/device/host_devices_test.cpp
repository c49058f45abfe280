// Several host devices in one process: whatever is stolen, slow or broken, the answer is that of one device, bit by
// bit, or an error that names the device. Truth: the factorization on one device with one thread.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "analysis/ordering.hpp"
#include "device/host/host_executor.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/generators/random.hpp"
#include "parameters.hpp"
#include "plan/plan.hpp"

namespace espalier {
namespace host_devices_test {

using device::FactorOutcome;
using device::host::HostOptions;

constexpr double kTiny = 1e-14;

struct System {
  std::vector<std::string> words;
  Kind kind;
  friend void PrintTo(const System& p, std::ostream* out) { test::print(*out, p.words, p.kind); }
};

std::vector<double> random_values(Offset n) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<double> v(static_cast<std::size_t>(n));
  for (double& x : v) x = uniform(random);
  return v;
}

// A plan for some devices and the threads that carry it out.
class Machine {
 public:
  Machine(const SparseMatrix& a, Kind kind, Index devices, int threads) : kind_(kind), a_(a), pool_(threads) {
    plan::PlanOptions options;
    options.devices = devices;
    options.additional_subtrees = 3;  // enough to steal
    options.unsymmetric = kind == Kind::lu;
    options.ldlt = kind == Kind::ldlt;
    options.group_entries = 1 << 14;
    options.reuse_distance = 8;
    options.tiles.max_block_size = 32;  // small systems, too, shall have fronts of many tiles
    options.tiles.whole_rows = 48;
    options.range_flops = 1e5;
    base::ThreadPool planner(1);
    plan_ = plan::make_plan(analysis::build_tree(analysis::graph_of(a, planner), {}, planner), a, {}, options, planner);
  }
  void start(HostOptions options = {}) {
    executor_ =
        device::host::make_host_executor<double>({plan_, kind_, false, {0.01, kTiny}, pool_}, std::move(options));
  }
  FactorOutcome factorize() { return executor_->factorize(a_.values); }
  // The solution for a fixed right-hand side, whose bits stand for those of the whole factor.
  std::vector<double> solve() {
    std::vector<double> x = random_values(a_.cols);
    executor_->solve(x.data(), 1, false);
    return x;
  }
  [[nodiscard]] const plan::Plan& plan() const { return plan_; }
  [[nodiscard]] std::vector<device::DeviceWork> work() const { return executor_->device_work(); }

 private:
  Kind kind_;
  const SparseMatrix& a_;
  base::ThreadPool pool_;
  plan::Plan plan_;
  std::unique_ptr<device::Executor<double>> executor_;
};

bool same_bits(const std::vector<double>& x, const std::vector<double>& y) {
  return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
}

Index stolen(const std::vector<device::DeviceWork>& work) {
  Index sum = 0;
  for (const auto& w : work) sum += w.stolen_subtrees;
  return sum;
}

class HostDevices : public ::testing::TestWithParam<System> {
 protected:
  void SetUp() override {
    base::ThreadPool pool(2);
    a_ = matrix::generate(matrix::parse_generator(GetParam().words), &pool);
    Machine one(a_, GetParam().kind, 1, 1);
    one.start();
    outcome_ = one.factorize();
    x_ = one.solve();
    EXPECT_TRUE(one.work().empty());
  }

  void expect_the_same(Machine& many, const FactorOutcome& outcome) {
    EXPECT_EQ(outcome.negative, outcome_.negative);
    EXPECT_EQ(outcome.two_by_two, outcome_.two_by_two);
    EXPECT_EQ(outcome.determinant_log, outcome_.determinant_log);
    EXPECT_TRUE(same_bits(many.solve(), x_));
  }

  SparseMatrix a_;
  FactorOutcome outcome_;
  std::vector<double> x_;
};

TEST_P(HostDevices, AnyNumberGivesTheBitsOfOne) {
  for (Index devices = 1; devices <= 8; ++devices) {
    const int team = 1 + devices % 2;
    Machine many(a_, GetParam().kind, devices, devices * team);
    many.start();
    SCOPED_TRACE(std::to_string(devices) + " devices of " + std::to_string(team));
    expect_the_same(many, many.factorize());
    EXPECT_EQ(static_cast<Index>(many.work().size()), devices == 1 ? 0 : devices);
  }
}

TEST_P(HostDevices, RandomSpeedsAndDelaysGiveTheSameBits) {
  Index thefts = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    std::mt19937_64 random(seed);
    const auto devices = static_cast<Index>(2 + random() % 7);
    Machine many(a_, GetParam().kind, devices, devices * static_cast<int>(1 + random() % 2));
    // One device in three is slow; now and then any task is late.
    std::vector<int> pause(static_cast<std::size_t>(devices));
    for (int& p : pause) p = random() % 3 == 0 ? 30 : 0;
    std::atomic<std::uint64_t> count{seed};
    HostOptions options;
    options.before_task = [&](Index device, const plan::Task&) {
      const int late = count.fetch_add(1) * 0x9e3779b97f4a7c15ULL >> 58 == 0 ? 200 : 0;
      const int wait = pause[static_cast<std::size_t>(device)] + late;
      if (wait > 0) std::this_thread::sleep_for(std::chrono::microseconds(wait));
    };
    many.start(options);
    SCOPED_TRACE("seed " + std::to_string(seed));
    expect_the_same(many, many.factorize());
    thefts += stolen(many.work());
  }
  EXPECT_GT(thefts, 0) << "nothing was stolen: the test tests nothing";
}

TEST_P(HostDevices, AnIdleDeviceStealsAllButOneSubTree) {
  // Device 0 does not get beyond its first task before device 1 has done all sub-trees but the one that it holds.
  Machine many(a_, GetParam().kind, 2, 2);
  const auto& a = many.plan().ownership;
  const Index subtrees = static_cast<Index>(a.subtrees.size());
  const Index of_first = static_cast<Index>(
      std::count_if(a.subtrees.begin(), a.subtrees.end(), [](const auto& s) { return s.device == 0; }));
  ASSERT_GT(of_first, 1);
  std::atomic<Index> others{0};
  std::atomic<bool> begun{false};  // device 0 holds a sub-tree
  HostOptions options;
  options.before_task = [&](Index device, const plan::Task& task) {
    if (device == 1) {
      while (!begun) std::this_thread::yield();
      const Index s = a.subtree(task.front);
      const bool begins = s >= 0 && &task == &many.plan().tasks[a.subtrees[static_cast<std::size_t>(s)].first_task];
      if (begins) ++others;
    } else {
      begun = true;
      while (others < subtrees - 1) std::this_thread::yield();
    }
  };
  many.start(options);
  expect_the_same(many, many.factorize());
  EXPECT_EQ(many.work()[1].stolen_subtrees, of_first - 1);
  EXPECT_EQ(many.work()[0].stolen_subtrees, 0);
}

TEST_P(HostDevices, ADeadDeviceIsNamedAndTheNextRunWorks) {
  for (const Index devices : {2, 3, 5}) {
    for (const int after : {0, 7, 40}) {
      Machine many(a_, GetParam().kind, devices, devices);
      const Index victim = after % devices;
      std::atomic<int> tasks{0};
      std::atomic<bool> armed{true}, died{false};
      HostOptions options;
      options.before_task = [&](Index device, const plan::Task&) {
        if (device != victim || !armed || tasks++ < after) return;
        died = true;
        throw std::runtime_error("the cable was pulled");
      };
      many.start(options);
      try {
        (void)many.factorize();
        EXPECT_FALSE(died) << "a failure went unnoticed";
      } catch (const Error& e) {
        EXPECT_EQ(e.status().code, StatusCode::device_error);
        const std::string text = e.what();
        EXPECT_NE(text.find("host device " + std::to_string(victim)), std::string::npos) << text;
        EXPECT_NE(text.find("cable"), std::string::npos) << text;
      }
      armed = false;
      expect_the_same(many, many.factorize());
    }
  }
}

TEST_P(HostDevices, BudgetsAreExact) {
  Machine many(a_, GetParam().kind, 3, 3);
  many.start();
  (void)many.factorize();
  Offset need = 0;
  for (const auto& w : many.work()) need = std::max(need, w.peak_bytes);
  HostOptions options;
  options.device_memory_bytes = {need, need, need};
  EXPECT_NO_THROW(many.start(options));
  std::vector<Offset> each;
  for (const auto& w : many.work()) each.push_back(w.peak_bytes);
  options.device_memory_bytes = each;
  EXPECT_NO_THROW(many.start(options));
  *std::find(options.device_memory_bytes.begin(), options.device_memory_bytes.end(), need) = need - 1;
  try {
    many.start(options);
    ADD_FAILURE() << "a budget that is one byte short was accepted";
  } catch (const Error& e) {
    EXPECT_EQ(e.status().code, StatusCode::out_of_memory);
    EXPECT_NE(std::string(e.what()).find(std::to_string(need) + " bytes"), std::string::npos) << e.what();
  }
}

TEST_P(HostDevices, FewerThreadsThanDevicesAreRefused) {
  Machine many(a_, GetParam().kind, 4, 3);
  try {
    many.start();
    ADD_FAILURE() << "a device without a thread";
  } catch (const Error& e) {
    EXPECT_EQ(e.status().code, StatusCode::invalid_input);
  }
}

INSTANTIATE_TEST_SUITE_P(Systems, HostDevices,
                         ::testing::Values(System{{"elasticity", "8"}, Kind::llt},
                                           System{{"kkt", "6", "4", "3", "3"}, Kind::ldlt},
                                           System{{"plate", "24", "24"}, Kind::ldlt},
                                           System{{"gyroscopic", "6"}, Kind::lu}));

}  // namespace host_devices_test
}  // namespace espalier
