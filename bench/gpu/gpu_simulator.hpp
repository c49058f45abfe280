/// \file
/// A GPU factorization in virtual time: the tasks of a device plan, taken in their order by the blocks that a GPU
/// holds, each as soon as a block is free and what it reads is there.
#pragma once

#include <vector>

#include "device/cuda/tables/device_plan.hpp"

namespace espalier::bench {

/// What one block of threads needs for a task, in seconds: `fixed`, and `chunk` for every 16 columns of products. When
/// the last operand comes late, the task ends `tail` after it.
struct TaskRate {
  double fixed, chunk, tail;
};

/// What plan::KernelRates say of one kind of factorization.
struct GpuRates {
  int narrow_blocks, wide_blocks;  ///< resident in the two kernels
  TaskRate block32, block64;       ///< row blocks of tile columns of 32 and 64
  TaskRate diagonal32, diagonal64;
  double whole;       ///< a whole small front
  double half_block;  ///< part of `chunk` that a row block of at most 64 rows takes
  double kernel;      ///< start of a kernel
  double hop;         ///< from the end of a task to when another GPU's block has what it made
};

GpuRates gpu_rates(const plan::MachineModel& machine, Kind kind);

struct SimulatedRun {
  double seconds = 0;
  std::vector<double> busy, waiting;  ///< devices; seconds, mean over the blocks
};

/// @pre the tables are for a run without stealing
SimulatedRun simulate(const device::cuda::DevicePlan& tables, const GpuRates& rates);

}  // namespace espalier::bench
