/// \file
/// The limits of this machine, so that every rate is also a fraction of its limit.
#pragma once

#include <nlohmann/json_fwd.hpp>

namespace espalier::bench {

struct CeilingSettings {
  int threads = 1;
  double seconds = 0.5;  ///< per figure
};

/// Our own dense product in FP64 on one and on all threads, bandwidth of the main memory (read; triad of McCalpin's
/// STREAM), and, for each GPU, its memory, its link to the host and to its peers, and the matrix product of cuBLAS
/// where that is installed. Keys: docs/guide/measure.md. What could not be measured is null or has a "reason".
nlohmann::json measure_ceilings(const CeilingSettings& settings);

/// The GPU part: an array, one object per GPU; empty without a driver.
nlohmann::json measure_gpu_ceilings(double seconds);

}  // namespace espalier::bench
