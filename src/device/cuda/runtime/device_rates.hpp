/// \file
/// What a GPU does per second, measured, so that unequal GPUs get unequal parts.
#pragma once

#include <string>

namespace espalier::device::cuda {

struct DeviceRates {
  double flops = 0;       ///< per second, FP64 products of 8 x 8 tiles by all warps from registers
  double copy_bytes = 0;  ///< per second, read and written, within the GPU's memory
  std::string refused;    ///< why the GPU could not be used; empty: it can
};

/// Measures a GPU in some ten milliseconds (and starts its context, if nothing has); once in a process, later calls
/// return the same figures. Thread-safe. Never throws: a GPU that fails says so in `refused`.
DeviceRates measured_rates(int device);

}  // namespace espalier::device::cuda
