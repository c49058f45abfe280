/// \file
/// Launches the kernel of residuals that suits a system and the number of columns. For device_linear_system.cu alone.
#pragma once

#include <span>

#include "device/cuda/executor/linear_system_memory.cuh"

namespace espalier::device::cuda {

/// On the executor's stream, whose device is current. Several columns stand packed in the memory of its right-hand
/// sides, which are not needed then.
/// @param aborted  see ResidualJob
/// @param end  pinned: what is found
template <class T>
void enqueue_residuals(LinearSystemMemory<T>& memory, CudaExecutor<T>& executor,
                       std::span<const ResidualColumn> columns, bool transpose, const int* aborted, ResidualEnd* end) {
  auto* const stream = static_cast<cudaStream_t>(executor.stream());
  ResidualJob job{};
  for (std::size_t k = 0; k < columns.size(); ++k) {
    job.b[k] = columns[k].b;
    job.x[k] = columns[k].x;
    job.r[k] = columns[k].r;
  }
  job.columns = static_cast<int>(columns.size());
  job.transpose = transpose;
  job.largest = memory.maxima();
  job.ticket = reinterpret_cast<int*>(memory.clock() + 2);
  job.clock = memory.clock();
  job.aborted = aborted;
  job.end = end;
  if (memory.complex()) {
    const dim3 blocks(memory.residual_blocks(false), static_cast<unsigned>(columns.size()));
    complex_residual_kernel<<<blocks, kSystemThreads, 0, stream>>>(memory.pattern(), memory.system().hermitian, job);
  } else if (columns.size() == 1 && memory.short_rows()) {
    residual_kernel<1, 2><<<memory.residual_blocks(false), kSystemThreads, 0, stream>>>(memory.pattern(), job);
  } else if (columns.size() == 1) {
    residual_kernel<1, 4><<<memory.residual_blocks(false), kSystemThreads, 0, stream>>>(memory.pattern(), job);
  } else {
    constexpr Index kWidth = kResidualColumns * static_cast<Index>(sizeof(double) / sizeof(T));
    auto* packed = reinterpret_cast<double*>(executor.device_rhs(kWidth));
    job.packed = packed;
    const Index doubles = memory.vector_doubles();
    pack_kernel<<<blocks_for(static_cast<Offset>(doubles) * kResidualColumns), kSystemThreads, 0, stream>>>(
        doubles, job, packed);
    call("launch of the packing kernel", [&] { return cudaGetLastError(); });
    residual_kernel<kResidualColumns, 1>
        <<<memory.residual_blocks(true), kSystemThreads, 0, stream>>>(memory.pattern(), job);
  }
  call("launch of the residual kernel", [&] { return cudaGetLastError(); });
}

}  // namespace espalier::device::cuda
