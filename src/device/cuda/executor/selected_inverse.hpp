/// \file
/// Entries of the inverse of a factored matrix on one GPU. For this backend alone: needs the CUDA runtime.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "device/cuda/runtime/table_upload.hpp"
#include "device/cuda/tables/inverse_tables.hpp"
#include "device/cuda/tables/tables.hpp"
#include "device/executor.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

/// Where a front's factor arrays lie.
template <class T>
struct InverseSource {
  const T* factor = nullptr;
  const T* second = nullptr;  ///< lu
  bool on_host = false;
};

/// The launches of the last call, for the next one that makes the same fronts.
struct KeptInverseTables {
  std::vector<char> needed, staged;  ///< fronts; see make_inverse_tables()
  Offset room = 0;                   ///< elements that there were
  InverseTables tables;
};

template <class T>
struct DeviceInverseJob {
  const plan::Plan& plan;
  Kind kind;
  std::span<const Front> fronts;          ///< of the plan
  std::vector<InverseSource<T>> sources;  ///< fronts
  const T* inverse_d = nullptr;           ///< ldlt, n; memory of the host or of the GPU
  const T* inverse_e = nullptr;           ///< likewise
  cudaStream_t stream = nullptr;
  DeviceBudget* budget = nullptr;  ///< from which memory is taken; null: `space` has it
  std::span<std::byte> space = {};
  TableUpload& uploads;
  base::ThreadPool* pool = nullptr;   ///< null: the calling thread
  KeptInverseTables* kept = nullptr;  ///< of earlier calls; null: nothing is kept
};

/// See Executor::invert_at(). Fronts are made level by level from the roots, as many at a time as there is memory for:
/// what is held are the inverses on the way from the roots. Its GPU must be current.
/// @throws Error(out_of_memory), Error(device_error)
template <class T>
void invert_on_device(const DeviceInverseJob<T>& job, const InverseEntries<T>& entries);

}  // namespace espalier::device::cuda
