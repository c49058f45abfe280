#include "plan/front_cost.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "analysis/fronts.hpp"

namespace espalier::plan {

namespace {

double seconds(double flops, double rows, double front, double flops_per_second, const MachineModel& m) {
  return front + flops / flops_per_second * (1 + m.half_rows / rows);
}

}  // namespace

double front_flops(Index pivots, Index rows, bool unsymmetric) {
  const double symmetric = analysis::front_flops(pivots, rows - pivots);
  return unsymmetric ? 2 * symmetric : symmetric;
}

double front_seconds(Index pivots, Index rows, bool unsymmetric, const MachineModel& m) {
  return seconds(front_flops(pivots, rows, unsymmetric), rows, m.dealt_front, m.flops, m);
}

double host_seconds(const analysis::AssemblyTree& tree, Kind kind, bool single, int threads, const MachineModel& m) {
  double flops = 0;
  for (Index f = 0; f < tree.fronts(); ++f)
    flops += front_flops(tree.pivots(f), tree.pivots(f) + tree.rows_below(f), kind == Kind::lu);
  const double precision = single ? m.single.value : 1.0;
  return flops / (m.flops * precision * threads) + m.front * tree.fronts() / threads;
}

GpuTime gpu_time(const analysis::AssemblyTree& tree, Kind kind, bool single, const MachineModel& m) {
  const double per_pivot = m.pivot.of(kind), flops_per_second = m.flops * (single ? m.single.value : 1.0);
  GpuTime t{0, 0, m};
  std::vector<double> chain(static_cast<std::size_t>(tree.fronts()), 0);
  for (Index f = 0; f < tree.fronts(); ++f) {
    const Index pivots = tree.pivots(f), parent = tree.parent[f];
    const Index rows = pivots + tree.rows_below(f);
    t.work_seconds += seconds(front_flops(pivots, rows, kind == Kind::lu), rows, m.front, flops_per_second, m);
    double& mine = chain[static_cast<std::size_t>(f)];
    mine += per_pivot * pivots;
    t.chain_seconds = std::max(t.chain_seconds, mine);
    if (parent >= 0) chain[static_cast<std::size_t>(parent)] = std::max(chain[static_cast<std::size_t>(parent)], mine);
  }
  return t;
}

double GpuTime::on(int devices) const {
  return chain_seconds + work_seconds / devices * (1 + machine.imbalance * (devices - 1)) + machine.launch * devices +
         machine.hand_over * std::log2(devices);
}

}  // namespace espalier::plan
