// Virtual time. Truth: with one block per GPU, tasks follow each other, so the time is the sum of theirs; work is the
// same for any number of devices; no run is shorter than its work over its blocks.
#include "gpu/gpu_simulator.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "matrix/generators/generate.hpp"

namespace espalier {
namespace gpu_simulator_test {

device::cuda::DevicePlan tables_for(Index devices) {
  base::ThreadPool pool{2};
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "9"}), &pool);
  device::cuda::DeviceTuning tuning;
  tuning.narrow_rows = 200;
  const auto plan = plan::make_plan(analysis::build_tree(analysis::graph_of(a, pool), {}, pool), a, {},
                                    device::cuda::cuda_plan_options(Kind::llt, tuning, devices), pool);
  return device::cuda::make_device_plan(plan, Kind::llt);
}

double work_of(const bench::SimulatedRun& run) { return std::accumulate(run.busy.begin(), run.busy.end(), 0.0); }

TEST(GpuSimulator, OneBlockTakesTheSumOfItsTasks) {
  bench::GpuRates rates = bench::gpu_rates(plan::h200(), Kind::llt);
  rates.narrow_blocks = rates.wide_blocks = 1;
  const auto run = bench::simulate(tables_for(1), rates);
  EXPECT_GT(work_of(run), 0);
  EXPECT_NEAR(run.seconds, work_of(run) + 2 * rates.kernel, 1e-9 * run.seconds);
  EXPECT_NEAR(run.waiting[0], 0, 1e-9 * run.seconds);
}

TEST(GpuSimulator, WorkIsTheSameOnAnyNumberOfDevices) {
  bench::GpuRates rates = bench::gpu_rates(plan::h200(), Kind::llt);
  rates.narrow_blocks = rates.wide_blocks = 1;
  const double one = work_of(bench::simulate(tables_for(1), rates));
  for (const Index devices : {2, 4, 16, 64}) {
    const auto run = bench::simulate(tables_for(devices), rates);
    EXPECT_NEAR(work_of(run), one, 1e-9 * one) << devices << " devices";
    EXPECT_GE(run.seconds, one / devices);
  }
}

TEST(GpuSimulator, MoreBlocksAndDevicesHelpAndSlowLinksHurt) {
  bench::GpuRates rates = bench::gpu_rates(plan::h200(), Kind::llt);
  rates.narrow_blocks = rates.wide_blocks = 4;
  const double one = bench::simulate(tables_for(1), rates).seconds;
  const double two = bench::simulate(tables_for(2), rates).seconds;
  EXPECT_LT(two, 0.8 * one);
  rates.hop *= 50;
  EXPECT_GT(bench::simulate(tables_for(2), rates).seconds, 1.05 * two);
  EXPECT_DOUBLE_EQ(bench::simulate(tables_for(1), rates).seconds, one);
}

}  // namespace gpu_simulator_test
}  // namespace espalier
