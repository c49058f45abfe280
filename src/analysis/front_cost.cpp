#include "analysis/front_cost.hpp"

#include "analysis/plan.hpp"

namespace espalier::analysis {

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

// One H200, many fronts at a time: fronts of 350, 1,400, 3,000 and 6,000 rows run at about 2, 12, 18 and 24 TFLOP/s.
double gpu_seconds(double flops, double rows) {
  constexpr double kFlopsPerSecond = 4e13;
  constexpr double kFront = 2e-7;
  constexpr double kHalfRows = 3500;
  return kFront + flops / kFlopsPerSecond * (1 + kHalfRows / rows);
}

}  // namespace

double front_seconds(Index pivots, Index rows, bool unsymmetric, CostModel model) {
  if (model == CostModel::count) return pivots;
  const double flops = front_flops(pivots, rows, unsymmetric);
  return model == CostModel::host ? host_seconds(flops, rows) : gpu_seconds(flops, rows);
}

}  // namespace espalier::analysis
