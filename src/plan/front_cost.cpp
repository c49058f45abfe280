#include "plan/front_cost.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "plan/plan.hpp"

namespace espalier::plan {

namespace {

// One AVX-512 core; the first two figures are those of the host's cost model in solver/device_choice.cpp. The third
// fits traces of elasticity 14^3 and a plate of 60 x 60 on one thread: fronts of 10^5 flops (some 60 rows) run at 8
// GFLOP/s, of 5 10^5 (120 rows) at 17, of 10^7 (400 rows) at 29.
double host_seconds(double flops, double rows) {
  constexpr double kFlopsPerSecond = 6e10;
  constexpr double kFront = 1.5e-6;  // seconds
  constexpr double kHalfRows = 300;  // rows of a front that runs at half the rate
  return kFront + flops / kFlopsPerSecond * (1 + kHalfRows / rows);
}

// One H200, many fronts at a time. Fits what two H200s gain over one on elasticity 24^3, 40^3 and 64^3 and the KKT
// chains of 20 and 400 bodies, within 20 %.
constexpr double kFrontOfPart = 5e-7;
double gpu_seconds(double flops, double rows, double front) {
  constexpr double kFlopsPerSecond = 4e13;
  constexpr double kHalfRows = 1800;
  return front + flops / kFlopsPerSecond * (1 + kHalfRows / rows);
}

}  // namespace

double front_seconds(Index pivots, Index rows, bool unsymmetric, CostModel model) {
  if (model == CostModel::count) return pivots;
  const double flops = front_flops(pivots, rows, unsymmetric);
  return model == CostModel::host ? host_seconds(flops, rows) : gpu_seconds(flops, rows, kFrontOfPart);
}

GpuTime gpu_time(const analysis::AssemblyTree& tree, bool unsymmetric, bool symmetric_indefinite) {
  // The diagonal tiles, one after another. KKT chains (L D L^T) of 2 and 200 bodies, 1,860 and 494 pivots in a chain,
  // take 0.8 and 0.3 ms however little else there is to do; elasticity 24^3, 4,977 pivots by L L^T, about 2.8.
  // A small front is one task of some 20 microseconds on one of 264 blocks: KKT chains of 200 bodies of (3,2,2) and
  // 1,000 of (2,1,1) with 468 and 1,037 fronts take 0.31 and 0.37 ms, 0.22 and 0.23 of it in the chain.
  constexpr double kFront = 1e-7;
  const double per_pivot = unsymmetric ? 9e-7 : symmetric_indefinite ? 4.3e-7 : 5.5e-7;
  GpuTime t;
  std::vector<double> chain(static_cast<std::size_t>(tree.fronts()), 0);
  for (Index f = 0; f < tree.fronts(); ++f) {
    const Index pivots = tree.pivots(f), parent = tree.parent[f];
    const Index rows = pivots + tree.rows_below(f);
    t.work_seconds += gpu_seconds(front_flops(pivots, rows, unsymmetric), rows, kFront);
    double& mine = chain[static_cast<std::size_t>(f)];
    mine += per_pivot * pivots;
    t.chain_seconds = std::max(t.chain_seconds, mine);
    if (parent >= 0) chain[static_cast<std::size_t>(parent)] = std::max(chain[static_cast<std::size_t>(parent)], mine);
  }
  return t;
}

double GpuTime::on(int devices) const {
  constexpr double kLaunch = 2e-5;     // of each device, by one host thread
  constexpr double kImbalance = 0.04;  // for every further device
  constexpr double kHandOver = 4e-5;   // through a shared front, two hops: 0.31 ms on one become 0.33 on two (KKT 200)
  return chain_seconds + work_seconds / devices * (1 + kImbalance * (devices - 1)) + kLaunch * devices +
         kHandOver * std::log2(devices);
}

}  // namespace espalier::plan
