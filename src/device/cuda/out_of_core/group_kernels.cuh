/// \file
/// Kernels for groups of block columns of a front that is too large for the device: what the group's arrays hold is
/// summed up in place, step by step, before the factorization kernel takes it from there.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "device/cuda/tables/tables.hpp"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// Entries of A, or columns [begin, end) below (not tile columns) of the child of link `link`.
template <class T>
struct AddedColumns {
  int link = -1;  ///< -1: entries of A
  int begin = 0, end = 0;
  const T* lower = nullptr;  ///< where the child's contribution array would begin
  const T* upper = nullptr;  ///< likewise of the transposed upper part (lu)
};

/// Pivot tile columns [begin, end) of the front.
template <class T>
struct SlabColumns {
  const T* part[2] = {nullptr, nullptr};  ///< L; U^T (lu) or L D (ldlt)
  int begin = 0, end = 0;
  int row = -1;  ///< chunks hold the padded rows from here on; -1: as in the factor array, which begins at `begin`
};

/// Front 1 of the state's tables is the large front, its arrays placed such that the group's columns fall on theirs;
/// tasks [first, end) are those of the group's columns.
template <class T, Kind K>
struct GroupKernels {
  static cudaError_t prepare();
  static cudaError_t add(const FactorState<T>& state, int first, int end, const AddedColumns<T>& part,
                         cudaStream_t stream);
  static cudaError_t update(const FactorState<T>& state, int width, int first, int end, const SlabColumns<T>& slab,
                            cudaStream_t stream);
};

}  // namespace espalier::device::cuda
