/// \file
/// The persistent solve kernel, as plain C++. Blocks hand values on through memory that was filled with a pattern that
/// no number has: who needs a value reads it until it is there, so a hand-over costs one trip through the cache and no
/// fence.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/tables.hpp"

namespace espalier::device::cuda {

inline constexpr int kManyColumns = 8;  ///< right-hand sides in one pass of the variant for many

/// All pointers are device memory, owned by the executor. Vectors hold `columns of a pass` values per row.
template <class T>
struct SolveState {
  const Front* fronts;
  const SolveTask* up;
  const SolveTask* down;
  int up_tasks;
  int down_tasks;
  int small_up;    ///< the first tasks of `up`: sub-trees of small fronts only
  int small_down;  ///< the last tasks of `down`: likewise
  const Link* links;
  const std::int32_t* bounds;
  const std::int32_t* relative;
  const std::int32_t* rows;  ///< AssemblyTree::rows
  T* const* base;            ///< regions; where each begins (see tables.hpp)
  const T* inverse_d;        ///< null but for ldlt
  const T* inverse_e;
  bool up_second;    ///< forward substitution with the second factor array (lu, transposed)
  bool down_second;  ///< backward substitution with it (lu)
  T* rhs;            ///< n x columns, row-major: right-hand sides on entry, solutions on return
  int columns;       ///< row length of rhs
  T* forward;        ///< n; filled with ones bits: solution of the forward substitution
  T* updates;        ///< rows below of all fronts; filled with ones bits
  T* solution;       ///< n; filled with ones bits
  int* control;      ///< [1] aborted, [2 .. 4] next task of each phase; zero
  std::uint64_t patience;
};

/// Blocks of each phase (small fronts up, all others, small fronts down) that are resident at the same time.
struct SolveShape {
  int blocks[3] = {};
};

template <class T>
struct SolveKernel {
  /// For the current device.
  static cudaError_t resident(bool many, SolveShape& shape);
  /// One pass for columns first_column .. of the right-hand sides: one (many false), or up to kManyColumns.
  static cudaError_t launch(bool many, const SolveShape& shape, const SolveState<T>& state, int first_column,
                            cudaStream_t stream);
};

}  // namespace espalier::device::cuda
