/// \file
/// What tests ask of the calls of the CUDA runtime: to refuse one without making it, as a driver might, and to write
/// down which are made.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

namespace espalier::device::cuda {

/// The calls of this process, counted; destructors' calls aside, which cannot fail.
struct CallFaults {
  std::atomic<std::int64_t> made{0};            ///< calls since the last arm()
  std::atomic<std::int64_t> refused_number{0};  ///< 0: none is refused
  std::atomic<const char*> refused{nullptr};    ///< name of the call that was refused since the last arm()
  /// Names of the calls, one after another, while not null. Owned by a test.
  std::atomic<std::vector<const char*>*> record{nullptr};
  std::mutex recording;  ///< several threads make calls while the sides of several GPUs are made

  /// Refuses call number `number` from now on (1: the next one); 0: none.
  void arm(std::int64_t number) {
    made = 0;
    refused = nullptr;
    refused_number = number;
  }
  /// Counts a call. @returns true when it must not be made
  bool refuses(const char* name) {
    if (auto* names = record.load(std::memory_order_relaxed)) {
      const std::lock_guard lock(recording);
      names->push_back(name);
    }
    if (++made != refused_number) return false;
    refused = name;
    return true;
  }
};

inline CallFaults& call_faults() {
  static CallFaults faults;
  return faults;
}

}  // namespace espalier::device::cuda
