/// \file
/// What a factorization came to, put together from what its sides have counted and marked.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "device/cuda/kernels/factor/factor_ends.hpp"
#include "device/executor.hpp"

namespace espalier::device::cuda {

/// What more there is to read after the counters.
struct SideFlags {
  bool stopped = false;   ///< a side was given up
  bool replaced = false;  ///< some pivot was replaced
  bool failed = false;    ///< some column of L grew beyond the bound
};

/// Adds one of `sides` sides. @param counters  its control memory: kCounters numbers
void add_counters(const int* counters, Index n, std::size_t sides, FactorOutcome& out, SideFlags& flags);

/// What one side did. @param counters  as above
DeviceWork work_of(const int* counters, std::string name, Offset held, Offset transferred_bytes);

/// Positions of columns that failed, by position.
void take_failed(const std::vector<unsigned char>& marks, FactorOutcome& out);
/// Positions of pivots that were replaced, or are small. @param marks  PivotMark, by position
void take_marks(const std::vector<unsigned char>& marks, FactorOutcome& out);
/// The product of the pivots, as the judge found it.
void take_determinant(const FactorEnd& end, FactorOutcome& out);

/// The product of the pivots, and those that are at most `smallest` of their positions (llt), on the host.
template <class T>
void judge_pivots(const std::vector<T>& pivots, std::span<const double> smallest, FactorOutcome& out);

}  // namespace espalier::device::cuda
