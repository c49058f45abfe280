/// \file
/// A generated system with its plan, as the GPU's executors take it: what espalier_gpu_check and espalier_memory_curve
/// share.
#pragma once

#include <string>
#include <vector>

#include "analysis/ordering.hpp"
#include "base/thread_pool.hpp"
#include "device/cuda/executor/cuda_executor.hpp"
#include "device/executor.hpp"
#include "espalier/matrix.hpp"
#include "solver/analysis/prepared_matrix.hpp"

namespace espalier::bench {

/// A system, its scaled and matched equations, its assembly tree and a plan for so many devices.
struct GpuCase {
  std::string name;  ///< words of the generator
  Kind kind = Kind::llt;
  SparseMatrix a;
  solver::PreparedMatrix prepared;
  analysis::AssemblyTree tree;
  int devices = 1;
  plan::Plan plan;
  double analysis_seconds = 0;  ///< without the plan
  double plan_seconds = 0;
};

/// Generates, scales, matches and orders. The plan is not laid out yet. @throws Error(invalid_input) for unknown words
GpuCase prepare_case(const std::string& name, Kind wish, base::ThreadPool& pool);
/// The plan of the CUDA executors for `devices` GPUs.
void lay_out_for_gpus(GpuCase& c, int devices, const device::cuda::DeviceTuning& tuning, base::ThreadPool& pool);
/// The plan of the host executor. `single`: for FP32.
void lay_out_for_host(GpuCase& c, bool single, base::ThreadPool& pool);

/// Numbers of one case in the order and precision of its plan.
template <class T>
struct GpuNumbers {
  /// Scales the values and settles the pivot rule.
  GpuNumbers(const GpuCase& c, base::ThreadPool& pool);
  std::vector<T> values;
  device::PivotRule rule;
};

/// b (n values a column, column by column) scaled and permuted, row by row as the executors take it.
template <class T>
std::vector<T> to_plan_order(const GpuCase& c, const std::vector<double>& b, Index columns);
/// The way back: the solution of the system as given, column by column.
template <class T>
std::vector<double> from_plan_order(const GpuCase& c, const std::vector<T>& x, Index columns);

/// Right-hand sides that no symmetry of a mesh makes easy: n values a column.
std::vector<double> test_right_hand_sides(Index n, Index columns);

/// Rounding error of T as the checks count it.
template <class T>
constexpr double unit_of() {
  return sizeof(T) == 4 ? 1.2e-7 : 2.2e-16;
}

const char* name_of(Kind kind);
/// "llt", "ldlt", "lu"; else automatic.
Kind kind_of(const std::string& name);

}  // namespace espalier::bench
