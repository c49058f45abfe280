/// \file
/// Which of the caller's values each of several devices assembles: what must reach it before a factorization.
#pragma once

#include <cstdint>
#include <vector>

#include "device/cuda/tables/device_plan.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

/// Values that are sent together: numbers chunk * kValueChunk and the following. A warp copies one, 256 bytes in FP64;
/// the values of a sub-tree stand in long runs (columns of neighbouring unknowns), so wider chunks would send little
/// less often, and more in vain.
inline constexpr Offset kValueChunk = 32;

/// Every front's entries are for the devices that are its members, those of a sub-tree that may be stolen for all.
/// @param values  length of the caller's value array
/// @param pool    null: on the calling thread
/// @returns by device: its chunks, ascending; nothing for the first, which has all values
std::vector<std::vector<std::uint32_t>> needed_values(const plan::Plan& plan, const DevicePlan& tables, Offset values,
                                                      base::ThreadPool* pool);

}  // namespace espalier::device::cuda
