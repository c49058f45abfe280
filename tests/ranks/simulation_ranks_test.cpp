// Simulations whose Newton matrices several ranks factorize. The truth is the simulation of one process: the same bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "device/registry.hpp"
#include "espalier/dynamics.hpp"
#include "on_threads.hpp"

namespace espalier::ranks {
namespace simulation_ranks_test {

// A bar that swings: elements enough that ranks share fronts.
const std::string kBar = R"(gravity = [0, 0, -9.81]
[integrator]
method = "generalized-alpha"
step = 0.002
end = 0.01
[bodies.bar]
type = "solid"
mesh = { part = "block", lx = 1, ly = 0.2, lz = 0.1, divisions = [8, 3, 2] }
material = { young = 2e9, poisson = 0.3, density = 7800 }
[joints.hinge]
type = "revolute"
a = { body = "ground", point = [0, 0.1, 0.05], axis = [0, 1, 0] }
b = { body = "bar", face = "x0", axis = [0, 1, 0] }
[output]
quantities = ["hinge.force", "energy.kinetic"]
)";

SimulationOptions options_of(std::vector<std::string> set) {
  SimulationOptions o;
  o.set = std::move(set);
  o.keep_series = true;
  o.solver = {{"device", "cpu"}, {"threads", "1"}};
  return o;
}

struct Motion {
  Status status;
  SimulationSeries series;
  SimulationSummary summary;
  std::string state;
};

Motion run_of(const std::string& text, SimulationOptions options, const SimulationObserver& observer = {}) {
  Motion r;
  Simulation simulation(std::move(options));
  r.status = simulation.load_text(text, "model.toml");
  if (r.status.ok()) {
    r.status = simulation.run(observer);
    r.series = simulation.series();
    r.state = simulation.save();
  }
  r.summary = simulation.summary();
  return r;
}

// Rank 0's run, and how the others have ended.
Motion run_on(int count, const std::string& text, const SimulationOptions& options, const Faults& faults = {},
              double patience = 60, std::vector<Status>* ends = nullptr, const SimulationObserver& observer = {}) {
  Motion first;
  std::mutex mutex;
  on_threads(
      count, faults,
      [&](const Ranks& ranks) {
        Status end;
        if (ranks.rank() == 0) {
          SimulationOptions o = options;
          o.ranks = ranks;
          first = run_of(text, o, observer);
          end = end_simulations(ranks);
        } else {
          end = serve_simulations(ranks);
        }
        const std::lock_guard lock(mutex);
        if (ends != nullptr) ends->push_back(end);
      },
      patience);
  return first;
}

void expect_same(const Motion& found, const Motion& truth) {
  ASSERT_TRUE(found.status.ok()) << found.status.message;
  ASSERT_TRUE(truth.status.ok()) << truth.status.message;
  ASSERT_GT(truth.series.values.size(), 0u);
  ASSERT_EQ(found.series.values.size(), truth.series.values.size());
  EXPECT_EQ(0, std::memcmp(found.series.values.data(), truth.series.values.data(),
                           truth.series.values.size() * sizeof(double)));
  EXPECT_EQ(found.state, truth.state);
  EXPECT_EQ(found.summary.factorizations, truth.summary.factorizations);
  EXPECT_EQ(found.summary.solves, truth.summary.solves);
  EXPECT_EQ(found.summary.followed, truth.summary.followed);
}

TEST(SimulationOnRanks, HasTheBitsOfOneProcess) {
  const Motion truth = run_of(kBar, options_of({}));
  EXPECT_GT(truth.summary.factorizations, 0);
  for (const int count : {2, 3}) {
    SCOPED_TRACE(std::to_string(count) + " ranks");
    std::vector<Status> ends;
    const Motion found = run_on(count, kBar, options_of({}), {}, 60, &ends);
    expect_same(found, truth);
    EXPECT_NE(found.summary.device.find(std::to_string(count) + " ranks"), std::string::npos) << found.summary.device;
    ASSERT_EQ(ends.size(), static_cast<std::size_t>(count));
    for (const Status& end : ends) EXPECT_TRUE(end.ok()) << end.message;
  }
}

TEST(SimulationOnRanks, LateMessagesAndOtherKinds) {
  Faults late;
  late.most_delay = 1e-4;
  late.reorder = true;
  late.credits = 3;
  SimulationOptions o = options_of({"integrator.end=0.006"});
  o.solver.emplace_back("kind", "ldlt");
  expect_same(run_on(2, kBar, o, late), run_of(kBar, o));
}

// Ranks with a GPU each take values and right-hand sides from the host: the answers are those of the processors but for
// rounding. GPUs of one process would take elements and vectors as well.
TEST(SimulationOnRanks, OnGpus) {
  const device::Backend* gpu = device::registry().find("gpu");
  const std::size_t gpus = gpu == nullptr ? 0 : gpu->find().names.size();
  if (gpus < 2) GTEST_SKIP() << "two GPUs are needed, " << gpus << " can be used";
  const Motion truth = run_of(kBar, options_of({}));
  SimulationOptions options = options_of({});
  std::erase_if(options.solver, [](const auto& o) { return o.first == "device"; });
  options.solver.emplace_back("device", "gpu:0,1");
  const Motion found = run_on(2, kBar, options);
  ASSERT_TRUE(found.status.ok()) << found.status.message;
  EXPECT_NE(found.summary.device.find("2 ranks"), std::string::npos) << found.summary.device;
  ASSERT_EQ(found.series.values.size(), truth.series.values.size());
  double largest = 0, most = 0;
  for (std::size_t k = 0; k < truth.series.values.size(); ++k) {
    largest = std::max(largest, std::abs(truth.series.values[k]));
    most = std::max(most, std::abs(found.series.values[k] - truth.series.values[k]));
  }
  EXPECT_GT(largest, 0);
  EXPECT_LE(most, 1e-6 * largest);
}

// Small systems have a dense solver, which nobody shares.
TEST(SimulationOnRanks, SmallModelsAreRankZeros) {
  const std::string text = R"(gravity = [0, -10, 0]
[bodies.bob]
type = "rigid"
mass = 2
inertia = [0.1, 0.1, 0.1]
position = [1, 0, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
[integrator]
end = 0.2
[output]
quantities = ["bob.position"]
)";
  SimulationOptions o = options_of({});
  o.solver.clear();
  expect_same(run_on(2, text, o), run_of(text, o));
}

TEST(SimulationOnRanks, MistakesAndStopsEndOnAll) {
  std::vector<Status> ends;
  EXPECT_EQ(run_on(2, "[bodies", options_of({}), {}, 60, &ends).status.code, StatusCode::invalid_input);
  SimulationOptions poor = options_of({});
  poor.solver.emplace_back("host_memory", "1000");
  EXPECT_EQ(run_on(2, kBar, poor, {}, 60, &ends).status.code, StatusCode::out_of_memory);
  const Motion stopped =
      run_on(2, kBar, options_of({}), {}, 60, &ends, [](const SimulationStep& s) { return s.index < 2; });
  EXPECT_TRUE(stopped.status.ok()) << stopped.status.message;
  EXPECT_TRUE(stopped.summary.interrupted);
  EXPECT_EQ(stopped.summary.steps, 2);
  EXPECT_EQ(ends.size(), 6u);
  for (const Status& end : ends) EXPECT_TRUE(end.ok()) << end.message;
}

// A rank that dies in the middle, told (ULFM) or in silence: a status that names it, on rank 0 and on whoever serves
// still.
TEST(SimulationOnRanks, ADeadRankEndsTheRun) {
  for (const auto& [dead, told] : {std::pair{0, true}, {1, true}, {1, false}}) {
    SCOPED_TRACE("rank " + std::to_string(dead) + (told ? ", told" : ", in silence"));
    Faults faults;
    faults.dead_rank = dead;
    faults.dies_at = 60;
    faults.deaths_are_told = told;
    std::vector<Status> ends;
    const Motion found = run_on(3, kBar, options_of({}), faults, told ? 60 : 2, &ends);
    EXPECT_EQ(found.status.code, StatusCode::device_error) << found.status.message;
    int named = 0;
    for (const Status& end : ends) {
      EXPECT_EQ(end.code, StatusCode::device_error);
      named += end.message.find("rank " + std::to_string(dead)) != std::string::npos ? 1 : 0;
    }
    EXPECT_GE(named, 2);
  }
}

TEST(SimulationOnRanks, WrongUseIsRefused) {
  EXPECT_THROW((void)serve_simulations(Ranks()), std::logic_error);
  EXPECT_TRUE(end_simulations(Ranks()).ok());
  on_threads(2, {}, [](const Ranks& ranks) {
    SimulationOptions o;
    o.ranks = ranks;
    if (ranks.rank() == 0) o.analyses = "folder";
    EXPECT_THROW(Simulation{o}, std::invalid_argument);
    if (ranks.rank() == 0) {
      EXPECT_THROW((void)serve_simulations(ranks), std::logic_error);
    } else {
      EXPECT_THROW((void)end_simulations(ranks), std::logic_error);
    }
  });
}

}  // namespace simulation_ranks_test
}  // namespace espalier::ranks
