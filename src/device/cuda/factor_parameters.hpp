/// \file
/// What the factorization kernel gets.
#pragma once

#include "device/cuda/tables.hpp"

namespace espalier::device::cuda {

/// Counters at the start of the control array; the flags follow at kFlagsAt.
enum Control : int {
  kNextNarrow = 0,   ///< next task of the narrow kernel
  kNextWide = 1,     ///< next task of the wide kernel
  kAborted = 2,      ///< nonzero: the run ends
  kNotPositive = 3,  ///< n - (lowest position with a pivot that is not positive), 0: none (llt)
  kNegative = 4,
  kTwoByTwo = 5,
  kReplaced = 6,
  kFailed = 7,
  kFlagsAt = 16
};

/// All pointers are device memory, owned by the executor.
template <class T>
struct FactorState {
  const Front* fronts;
  const FactorTask* tasks;
  const Link* links;
  const std::int32_t* bounds;
  const std::int32_t* waits;
  const std::int32_t* relative;   ///< Plan::relative
  const std::int64_t* entry_ptr;  ///< Plan::entry_ptr
  const std::uint64_t* entries;   ///< Plan::entries, packed
  const T* values;                ///< the caller's values
  T* const* base;                 ///< regions; where each begins (see tables.hpp)
  T* inverse_d;                   ///< n; diagonal of D^-1 (ldlt)
  T* inverse_e;                   ///< n; its subdiagonal: e[k] couples k and k + 1
  T* pivot;                       ///< n; pivots with signs, whose product is the determinant
  unsigned char* replaced;        ///< n; 1: the pivot was replaced
  unsigned char* failed;          ///< n; 1: the column of L grew beyond `growth`
  int* control;                   ///< counters and flags
  int* finished;                  ///< fronts; tasks done
  const T* limits;                ///< [0] pivots below it are replaced; [1] largest |L| that is not reported
  std::uint64_t patience;         ///< nanoseconds that one wait may last before the kernel gives up
  std::int64_t part_flags;        ///< flags of one part; those of part 1 (lu) follow those of part 0

  ESPALIER_BOTH T tiny() const { return limits[0]; }
  ESPALIER_BOTH T growth() const { return limits[1]; }
  ESPALIER_BOTH int* flags(int part) const { return control + kFlagsAt + part * part_flags; }
};

}  // namespace espalier::device::cuda
