/// \file
/// The persistent solve kernel, as plain C++. Blocks hand values on through memory that was filled with a pattern that
/// no number has: who needs a value reads it until it is there, so a hand-over costs one trip through the cache and no
/// fence.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/tables/tables.hpp"

namespace espalier::device::cuda {

inline constexpr int kSlab = 8;          ///< right-hand sides that a tensor-core product takes
inline constexpr int kManyColumns = 32;  ///< most right-hand sides of one pass; one, or a multiple of kSlab

/// All pointers are device memory, owned by the executor. Vectors hold `pass` values per row.
template <class T>
struct SolveState {
  const Front* fronts;
  const SolveTask* up;
  const SolveTask* down;
  int up_tasks;
  int down_tasks;
  int small_up;                ///< the first tasks of `up`: sub-trees of small fronts only
  int small_down;              ///< the last tasks of `down`: likewise
  const unsigned char* marks;  ///< fronts; PathMark. Null: all fronts are passed
  const ChildRows* links;
  const std::int32_t* bounds;
  const std::int32_t* relative;
  const std::int32_t* rows;  ///< AssemblyTree::rows
  T* const* base;            ///< regions; where each begins (see tables.hpp)
  const T* inverse_d;        ///< null but for ldlt
  const T* inverse_e;
  bool up_second;                       ///< forward substitution with the second factor array (lu, transposed)
  bool down_second;                     ///< backward substitution with it (lu)
  bool up_triangular, down_triangular;  ///< inverses of diagonal tiles are lower triangles in what they use
  const T* rhs;                         ///< n x columns, row-major: right-hand sides
  T* result;                            ///< likewise: solutions; may be `rhs` (one device), may lie on another device
  int columns;                          ///< row length of rhs
  int pass;          ///< right-hand sides of the pass, row length of the vectors: 1, or a multiple of kSlab
  int first_column;  ///< of the pass
  T* forward;        ///< n; filled with ones bits: solution of the forward substitution
  T* updates;        ///< rows below of all fronts; filled with ones bits
  T* solution;       ///< n; filled with ones bits
  int* control;      ///< [1] aborted, [2 .. 4] next task of each phase; zero
  std::uint64_t patience;
  // Several devices: all members of a front of the top do all of its tasks; of them, the one with the lowest number
  // hands updates to the other readers and writes the solution.
  int devices = 1;
  int self = 0;
  T* peer_updates[kMostDevices] = {};
  int* peer_control[kMostDevices] = {};

  [[nodiscard]] ESPALIER_BOTH bool speaks_for(const Front& f) const {
    return devices == 1 || (f.members & ((1u << self) - 1)) == 0;
  }
  /// Other devices that gather the front's updates and do not make them themselves.
  [[nodiscard]] ESPALIER_BOTH unsigned listeners(const Front& f) const {
    return devices > 1 && speaks_for(f) ? f.readers & ~static_cast<unsigned>(f.members) : 0;
  }
};

/// Copies `count` elements from any device's memory to any other's.
template <class T>
cudaError_t launch_copy(T* to, const T* from, std::int64_t count, cudaStream_t stream);

/// Launch shapes of each phase (small fronts up, all others, small fronts down) for tasks of one right-hand side, of
/// kSlab, and of two times as many (large fronts only).
struct SolveLaunches {
  int blocks[3][3] = {};  ///< that are resident at the same time
  int bytes[3][3] = {};   ///< of shared memory of each
};

template <class T>
struct SolveKernel {
  /// For the current device.
  static cudaError_t resident(SolveLaunches& shape);
  /// One pass, for state.pass right-hand sides from state.first_column on.
  static cudaError_t launch(const SolveLaunches& shape, const SolveState<T>& state, cudaStream_t stream);
};

}  // namespace espalier::device::cuda
