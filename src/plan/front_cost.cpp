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

// The longest path from a leaf to the root, by the lengths of its fronts.
class LongestPath {
 public:
  explicit LongestPath(const analysis::AssemblyTree& tree) : tree_(tree), to_(at(tree.fronts()), 0) {}
  // The costs of all fronts, in ascending order.
  void add(Index f, double length) {
    double& mine = to_[at(f)];
    mine += length;
    length_ = std::max(length_, mine);
    if (const Index parent = tree_.parent[f]; parent >= 0) {
      double& above = to_[at(parent)];
      above = std::max(above, mine);
    }
  }
  [[nodiscard]] double length() const { return length_; }

 private:
  const analysis::AssemblyTree& tree_;
  std::vector<double> to_;  // fronts
  double length_ = 0;
};

}  // namespace

double front_flops(Index pivots, Index rows, bool unsymmetric) {
  const double symmetric = analysis::front_flops(pivots, rows - pivots);
  return unsymmetric ? 2 * symmetric : symmetric;
}

double front_seconds(Index pivots, Index rows, bool unsymmetric, const MachineModel& m) {
  return seconds(front_flops(pivots, rows, unsymmetric), rows, m.dealt_front, m.flops, m);
}

double host_seconds(const analysis::AssemblyTree& tree, Kind kind, bool single, int threads, const MachineModel& m) {
  const double flops_per_second = m.flops * (single ? m.single.value : 1.0);
  double work = 0;
  LongestPath path(tree);
  for (Index f = 0; f < tree.fronts(); ++f) {
    const Index pivots = tree.pivots(f), rows = pivots + tree.rows_below(f);
    const double one = seconds(front_flops(pivots, rows, kind == Kind::lu), rows, m.front, flops_per_second, m);
    work += one;
    path.add(f, one / std::clamp(rows / m.thread_rows, 1.0, static_cast<double>(threads)));
  }
  return std::max(work / threads, path.length());
}

GpuTime gpu_time(const analysis::AssemblyTree& tree, Kind kind, bool single, const MachineModel& m) {
  const double per_pivot = m.pivot.of(kind), flops_per_second = m.flops * (single ? m.single.value : 1.0);
  GpuTime t{0, 0, m};
  LongestPath path(tree);
  for (Index f = 0; f < tree.fronts(); ++f) {
    const Index pivots = tree.pivots(f), rows = pivots + tree.rows_below(f);
    t.work_seconds += seconds(front_flops(pivots, rows, kind == Kind::lu), rows, m.front, flops_per_second, m);
    path.add(f, per_pivot * pivots);
  }
  t.chain_seconds = path.length();
  return t;
}

double GpuTime::on(int devices) const {
  return chain_seconds + work_seconds / devices * (1 + machine.imbalance * (devices - 1)) + machine.launch * devices +
         machine.hand_over * std::log2(devices);
}

}  // namespace espalier::plan
