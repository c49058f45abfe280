// Clusters in virtual time. Truth: one GPU takes the sum of its fronts; no run is shorter than its work over its GPUs
// or than its chain; every panel crosses once to each machine; and what the finer simulator of tiles says.
#include "cluster/cluster_simulator.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "analysis/ordering.hpp"
#include "gpu/gpu_simulator.hpp"
#include "matrix/generators/generate.hpp"

namespace espalier::bench {
namespace cluster_simulator_test {

class Clusters : public ::testing::Test {
 protected:
  plan::Plan plan_for(Index devices, Index ranks = 1) const {
    plan::PlanOptions options = device::cuda::cuda_plan_options(Kind::llt, {}, devices);
    options.ranks = ranks;
    return plan_of_tree(tree_, 3, options);
  }
  base::ThreadPool pool_{2};
  SparseMatrix a_ = brick_nodes(16);
  analysis::AssemblyTree tree_ = analysis::build_tree(analysis::graph_of(a_, pool_), {}, pool_);
};

TEST_F(Clusters, OneGpuTakesTheSumOfItsFronts) {
  const plan::Plan plan = plan_for(1);
  ClusterRates rates;
  rates.gpu.pivot = {};  // no chain
  double sum = rates.gpu.start;
  for (Index f = 0; f < plan.fronts(); ++f) sum += plan::front_seconds(plan, f) / rates.speed;
  const ClusterRun run = simulate(plan, rates);
  EXPECT_NEAR(run.seconds, sum, 1e-9 * sum);
  EXPECT_EQ(run.network_bytes, 0);
  EXPECT_NEAR(kept_factors(plan)[0].subtrees, run.factor_bytes, 1);
  EXPECT_GE(run.factor_bytes, 8.0 * static_cast<double>(plan.nonzeros_factor));
}

TEST_F(Clusters, NoRunBeatsItsBounds) {
  const double one = simulate(plan_for(1), {}).work;
  for (const Index devices : {2, 8, 16, 128}) {
    const ClusterRun run = simulate(plan_for(devices, std::max<Index>(1, devices / 8)), {});
    EXPECT_NEAR(run.work * devices, one, 1e-9 * one) << devices;
    EXPECT_GE(run.seconds, run.work);
    EXPECT_GE(run.seconds, run.chain);
    EXPECT_GE(run.seconds, run.network);
    EXPECT_EQ(run.network_bytes > 0, devices > 8);
  }
}

// Both triangles of a matrix that has one.
SparseMatrix mirrored(const SparseMatrix& lower) {
  std::vector<std::vector<Index>> columns(static_cast<std::size_t>(lower.cols));
  for (Index c = 0; c < lower.cols; ++c)
    for (auto q = static_cast<std::size_t>(lower.col_ptr[static_cast<std::size_t>(c)]);
         q < static_cast<std::size_t>(lower.col_ptr[static_cast<std::size_t>(c) + 1]); ++q) {
      const Index r = lower.row_ind[q];
      columns[static_cast<std::size_t>(c)].push_back(r);
      if (r != c) columns[static_cast<std::size_t>(r)].push_back(c);
    }
  SparseMatrix both{lower.rows, lower.cols, {0}, {}, {}, Storage::symmetric_both};
  for (const auto& column : columns) {
    both.row_ind.insert(both.row_ind.end(), column.begin(), column.end());
    both.col_ptr.push_back(static_cast<Offset>(both.row_ind.size()));
  }
  return both;
}

// What is counted of a tree is what make_plan() makes of it, rank by rank.
TEST_F(Clusters, PlansOfRanksAreWhatIsCounted) {
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"poisson", "14"}));
  ASSERT_EQ(a.storage, Storage::symmetric_lower);
  const analysis::AssemblyTree tree = analysis::build_tree(analysis::graph_of(a, pool_), {}, pool_);
  const SparseMatrix both = mirrored(a);
  for (const Index ranks : {1, 4}) {
    plan::PlanOptions options;
    options.devices = options.ranks = ranks;
    options.stealing = false;
    options.balance_columns = true;
    options.additional_subtrees = 0;
    const auto counted = planned_bytes(plan_of_tree(tree, 1, options), both, tree, 1);
    ASSERT_EQ(counted.size(), static_cast<std::size_t>(ranks));
    for (options.rank = 0; options.rank < ranks; ++options.rank) {
      const plan::PlanBytes made = plan::bytes_of(plan::make_plan(tree, a, {}, options, pool_));
      const plan::PlanBytes& count = counted[static_cast<std::size_t>(options.rank)];
      EXPECT_EQ(made.entries, count.entries);
      EXPECT_EQ(made.rows, count.rows);
      EXPECT_EQ(made.tiles, count.tiles);
      EXPECT_EQ(made.tasks, count.tasks);
      EXPECT_NEAR(static_cast<double>(made.tree), static_cast<double>(count.tree),
                  0.05 * static_cast<double>(made.tree));
    }
  }
}

TEST_F(Clusters, SlowNetworksHurtAndRelaysSendAsMuch) {
  const plan::Plan plan = plan_for(32, 4);
  ClusterRates rates;
  const ClusterRun fast = simulate(plan, rates);
  rates.relay = true;
  const ClusterRun relayed = simulate(plan, rates);
  EXPECT_NEAR(relayed.network_bytes, fast.network_bytes, 1e-9 * fast.network_bytes);
  rates.relay = false;
  rates.network /= 20;
  EXPECT_GT(simulate(plan, rates).seconds, 1.2 * fast.seconds);
  rates.network = std::numeric_limits<double>::infinity();
  rates.network_hop = 0;
  EXPECT_LE(simulate(plan, rates).seconds, fast.seconds);
}

TEST_F(Clusters, NodesAreThoseOfElasticity) {
  const SparseMatrix a =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "16"}), &pool_);
  EXPECT_EQ(3 * a_.rows, a.rows);
  const auto fine = plan::make_plan(analysis::build_tree(analysis::graph_of(a, pool_), {}, pool_), a, {},
                                    device::cuda::cuda_plan_options(Kind::llt, {}, 1), pool_);
  EXPECT_NEAR(plan_for(1).flops, fine.flops, 0.2 * fine.flops);  // other leaves
}

// Tiles of the same system, taken from the CUDA tables: within a third, on as many GPUs as the work is enough for.
TEST_F(Clusters, AgreesWithTiles) {
  const SparseMatrix a =
      matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "16"}), &pool_);
  const auto tree = analysis::build_tree(analysis::graph_of(a, pool_), {}, pool_);
  for (const Index devices : {1, 2}) {
    const auto fine = plan::make_plan(tree, a, {}, device::cuda::cuda_plan_options(Kind::llt, {}, devices), pool_);
    const double truth =
        simulate(device::cuda::make_device_plan(fine, Kind::llt), gpu_rates(plan::h200(), Kind::llt)).seconds;
    const double found = simulate(plan_for(devices), {}).seconds;
    EXPECT_NEAR(found, truth, truth / 3) << devices << " GPUs";
  }
}

}  // namespace cluster_simulator_test
}  // namespace espalier::bench
