/// \file
/// Memory of this process as the Linux kernel counts it.
#pragma once

#include "espalier/types.hpp"

namespace espalier::bench {

/// Bytes resident now (VmRSS of /proc/self/status).
Offset resident_bytes();
/// Most bytes resident since the start or the last reset_peak_memory() (VmHWM).
Offset peak_resident_bytes();
/// Gives freed memory back and sets VmHWM to the present VmRSS (/proc/self/clear_refs, value 5; see man 5 proc).
void reset_peak_memory();

}  // namespace espalier::bench
