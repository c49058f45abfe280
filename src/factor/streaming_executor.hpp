/// \file
/// Factorization in a device memory of any size: carries out a streaming plan on a backend, and keeps the factor in the
/// host's memory.
#pragma once

#include <memory>

#include "device/stream_backend.hpp"

namespace espalier::factor {

struct StreamingOptions {
  Offset budget_bytes = 0;      ///< of device memory
  Offset slot_bytes = 8 << 20;  ///< of a buffer of the staging ring
  int slots = 6;                ///< buffers in each direction
  int copy_threads = 1;         ///< in each direction
  analysis::StreamRates rates;
};

/// Substitution runs on the host, where the factor is: it does two operations per number, so the host's memory, several
/// times faster than the link, bounds it.
/// @throws Error(out_of_memory) naming the least budget that works
template <class T>
std::unique_ptr<device::Executor<T>> make_streaming_executor(std::unique_ptr<device::StreamBackend<T>> backend,
                                                             const StreamingOptions& options,
                                                             base::MemoryBudget* budget);

}  // namespace espalier::factor
