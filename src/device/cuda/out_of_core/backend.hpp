/// \file
/// Out of core on a GPU. The header needs no CUDA.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "base/thread_pool.hpp"
#include "out_of_core/backend.hpp"

namespace espalier::device::cuda {

struct CudaOutOfCoreOptions {
  int device = 0;
  double patience_seconds = 30;  ///< a wait between blocks that lasts longer ends the run with an error
};

/// Bytes of device memory that are free, less a reserve for what the driver takes.
Offset free_device_bytes(int device);

/// Backends of several GPUs for one factorization; they share their tables, and the first one does the solves.
/// @param plan  made with cuda_plan_options(kind), for any number of devices; must outlive the backends
/// @param pool  its threads do the substitutions
/// All memory is taken by prepare().
template <class T>
std::vector<std::unique_ptr<out_of_core::OutOfCoreBackend<T>>> make_cuda_out_of_core_backends(
    const plan::Plan& plan, Kind kind, const PivotRule& rule, base::ThreadPool& pool,
    const std::vector<CudaOutOfCoreOptions>& devices);

/// One GPU.
template <class T>
std::unique_ptr<out_of_core::OutOfCoreBackend<T>> make_cuda_out_of_core_backend(
    const plan::Plan& plan, Kind kind, const PivotRule& rule, base::ThreadPool& pool,
    const CudaOutOfCoreOptions& options = {}) {
  return std::move(make_cuda_out_of_core_backends<T>(plan, kind, rule, pool, {options}).front());
}

}  // namespace espalier::device::cuda
