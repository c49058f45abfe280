/// \file
/// What stands before and after a solve that passes some fronts alone. As plain C++.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/tables/tables.hpp"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// Makes the rows of fronts on the paths what a pass expects: vectors full of ones bits, right-hand sides zero. All
/// pointers are device memory.
template <class T>
struct PathBegin {
  const Front* fronts;
  const std::int32_t* passed;  ///< `count` fronts on the paths
  int count;
  const unsigned char* marks;  ///< fronts; PathMark
  T* forward;                  ///< `pass` values a row, as in SolveState
  T* updates;
  T* solution;
  int pass;
  T* rhs;  ///< `columns` values a row; null: they stay
  int columns;
  int* control;  ///< becomes zero
  int control_size;
};
template <class T>
cudaError_t launch_path_begin(const PathBegin<T>& job, cudaStream_t stream);

/// Copies `count` rows of `columns` values to rows to_rows[k] from rows from_rows[k]; null: row k.
template <class T>
struct RowCopy {
  T* to;
  const std::int32_t* to_rows;
  const T* from;
  const std::int32_t* from_rows;
  Offset count;
  int columns;
};
template <class T>
cudaError_t launch_row_copy(const RowCopy<T>& job, cudaStream_t stream);

}  // namespace espalier::device::cuda
