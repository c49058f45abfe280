#include "dynamics/integrators/factor_renewal.hpp"

#include <algorithm>
#include <cmath>

namespace espalier::dynamics {

namespace {
// Seconds of one core, from the chain of 400 bars (build/release/bench/espalier_bench_chain, 4,400 unknowns): a
// factorization takes 1.7 ms, a solve 0.17, a tangent 0.15, forces, constraints and vectors 0.25.
constexpr double kFlop = 1 / 8e9, kFront = 1.5e-6, kEntryOfK = 6e-9, kEntryOfW = 4e-9;
constexpr double kNumberOfFactor = 8 / 1e10, kFrontOfSolve = 1e-7, kUnknown = 6e-8;
// On a GPU launches and transfers make passes of large systems dear: 5 to 8 of them take as long as a factor and its
// tangent (docs/notebook/dynamics.md, "When a factor is renewed").
constexpr double kLargestCost = 64, kLargestCostOnGpu = 8;
}  // namespace

double passes_of_factor(const NewtonWork& work) {
  FactorWork factor = work.factor;
  const double n = work.unknowns;
  if (factor.flops == 0) factor = {2 * n * n * n / 3, 1, static_cast<Offset>(n * n)};
  const double renewal = factor.flops * kFlop + factor.fronts * kFront +
                         static_cast<double>(work.entries_of_k) * kEntryOfK +
                         static_cast<double>(work.entries_of_w) * kEntryOfW;
  const double pass =
      static_cast<double>(factor.numbers) * kNumberOfFactor + factor.fronts * kFrontOfSolve + n * kUnknown;
  const double power = pass > 0 ? std::exp2(std::round(std::log2(renewal / pass))) : 1;
  return std::clamp(power, 1.0, work.on_gpu ? kLargestCostOnGpu : kLargestCost);
}

}  // namespace espalier::dynamics
