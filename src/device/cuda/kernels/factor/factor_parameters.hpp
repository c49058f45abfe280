/// \file
/// What the factorization kernel gets.
#pragma once

#include <array>

#include "device/cuda/tables/tables.hpp"
#include "device/factor_outcome.hpp"

namespace espalier::device::cuda {

/// See FactorState::limits.
template <class T>
using PivotLimits = std::array<T, 4>;

template <class T>
PivotLimits<T> limits_of(const PivotRule& rule) {
  return {static_cast<T>(rule.tiny), static_cast<T>(1 / rule.threshold), static_cast<T>(rule.suspect),
          static_cast<T>(rule.largest)};
}

/// Counters: the control array. Flags and finished tasks have arrays of their own.
enum Control : int {
  kNextNarrow = 0,   ///< next task of the narrow kernel
  kNextWide = 1,     ///< next task of the wide kernel
  kAborted = 2,      ///< nonzero: the run ends
  kNotPositive = 3,  ///< n - (lowest position with a pivot that is not positive), 0: none (llt)
  kNegative = 4,
  kTwoByTwo = 5,
  kReplaced = 6,
  kFailed = 7,
  kBusy = 8,     ///< 64 bits: nanoseconds in tasks, mean over the blocks
  kWaited = 10,  ///< 64 bits: of these, nanoseconds of waiting for other tasks
  kSlot = 12,    ///< 1: the memory for a stolen sub-tree is taken
  kStolen = 13,  ///< sub-trees of other devices that this one did
  kNear = 14,    ///< nonzero: a search for a pivot went on from a row of less than kNearTiny times limits [0] (ldlt)
  kOpened = 16,  ///< by stealable sub-tree: 0 not known, 1 this device does it, 2 another one does, 3 being found out
  kClaims = 32,  ///< by stealable sub-tree, of device 0 alone: who does it (device + 1), 0: nobody yet
  kCounters = 48
};

inline constexpr int kNearTiny = 1024;

/// The devices that share a factorization, as one of them sees them; entry d belongs to device d.
template <class T>
struct Peers {
  int count = 1;  ///< 1: there are none, or all see the same flags and the same copy of the top
  int self = 0;
  bool same_memory =
      false;  ///< all see the same: what a task makes must be visible to all devices before its flag is set
  T* top[kMostDevices] = {};        ///< region 0
  int* control[kMostDevices] = {};  ///< counters
  int* flag[kMostDevices] = {};
  T** base[kMostDevices] = {};  ///< FactorState::base
  T* home[kMostDevices] = {};   ///< by stealable sub-tree: where it lies unless it is stolen
  T* pivot[kMostDevices] = {};  ///< FactorState::pivot; inverse_d and inverse_e follow n elements after each other

  /// The others among `devices` (bit d: device d).
  [[nodiscard]] ESPALIER_BOTH unsigned others(unsigned devices) const { return devices & ~(1u << self); }
};

/// When a task was taken and finished, by the device's clock in nanoseconds, and how much of it was waiting.
struct TaskTime {
  std::uint64_t begin = 0, end = 0;
  std::uint32_t waited = 0;
  std::uint32_t block = 0;
};

/// All pointers are device memory, owned by the executor.
template <class T>
struct FactorState {
  const Front* fronts;
  const FactorTask* tasks;
  const ChildRows* links;
  const std::int32_t* bounds;
  const std::int32_t* waits;
  const std::int32_t* relative;   ///< Plan::relative
  const std::int64_t* entry_ptr;  ///< Plan::entry_ptr
  const std::uint64_t* entries;   ///< Plan::entries, packed
  const T* values;                ///< the caller's values
  T* const* base;                 ///< regions; where each begins (see tables.hpp)
  T* const* places;               ///< tile columns of contributions that lie outside of regions, see Front::place()
  T* inverse_d;                   ///< n; diagonal of D^-1 (ldlt)
  T* inverse_e;                   ///< n; its subdiagonal: e[k] couples k and k + 1
  T* pivot;                       ///< n; pivots with signs, whose product is the determinant
  unsigned char* replaced;        ///< n; 1: the pivot was replaced
  unsigned char* failed;          ///< n; 1: the column of L grew beyond `growth`
  int* control;                   ///< counters
  int* flag;                      ///< parts x part_flags; see Front::flag()
  int* finished;                  ///< fronts; tasks done
  const T* limits;                ///< [0] pivots below it are replaced; [1] largest |L| that is not reported;
                                  ///< [2] kept pivots below it are reported as small (ldlt, lu);
                                  ///< [3] no entry of the matrix is larger in magnitude
  std::uint64_t patience;         ///< nanoseconds that one wait may last before the kernel gives up
  std::int64_t part_flags;        ///< flags of one part; those of part 1 (lu) follow those of part 0
  Peers<T> peers;
  /// Regions from this one on are sub-trees that any device may do: the first to claim one does it, and tells the
  /// others where it lies.
  int first_stealable = 1 << 30;
  T* spare = nullptr;                  ///< memory for one sub-tree of another device
  const int* stealable_end = nullptr;  ///< by stealable sub-tree: place after its last task in this device's list
  TaskTime* trace = nullptr;           ///< tasks; null: not wanted
  unsigned delay = 0;                  ///< nanoseconds that every task is held up (for tests)

  ESPALIER_BOTH T tiny() const { return limits[0]; }
  ESPALIER_BOTH T growth() const { return limits[1]; }
  ESPALIER_BOTH T largest() const { return limits[3]; }
  ESPALIER_BOTH int* flags(int part) const { return flag + part * part_flags; }
};

}  // namespace espalier::device::cuda
