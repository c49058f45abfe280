/// \file
/// What a GPU does per second, measured, so that unequal GPUs get unequal parts.
#pragma once

#include "device/device_rates.hpp"

namespace espalier::device::cuda {

/// Measures a GPU (products of 8 x 8 tiles by all warps from registers; a copy) in some ten milliseconds (and starts
/// its context, if nothing has); once in a process, later calls return the same figures. Thread-safe. Never throws: a
/// GPU that fails says so in `refused`.
DeviceRates measured_rates(int device);

}  // namespace espalier::device::cuda
