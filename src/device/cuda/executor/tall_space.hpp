/// \file
/// device::TallSpace on a GPU. No CUDA header is needed.
#pragma once

#include <memory>

#include "device/tall_space.hpp"

namespace espalier::device::cuda {

/// @param memory_bytes  budget; 0: what is free
/// @throws Error(device_error), Error(out_of_memory)
std::unique_ptr<TallSpace> make_tall_space(Index rows, int device, Offset memory_bytes);

}  // namespace espalier::device::cuda
