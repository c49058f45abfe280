/// \file
/// Arrays of other processes on this machine, opened by CUDA IPC. For this backend alone: needs the CUDA runtime.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <string>
#include <vector>

#include "device/cuda/executor/device_side.hpp"
#include "ranks/link.hpp"

namespace espalier::device::cuda {

/// What ranks of a machine reach of each other's memory. Ranks are processes, each with a GPU, or threads of one
/// process with different GPUs.
///
/// The memory of a rank that has died stays mapped as long as this object lives; nobody will set its flags any more.
template <class T>
class ReachedMemory {
 public:
  /// @param device  of this rank
  ReachedMemory(ranks::Link& link, int device) : link_(link), device_(device) {}
  ReachedMemory(const ReachedMemory&) = delete;
  ReachedMemory& operator=(const ReachedMemory&) = delete;
  ~ReachedMemory() { close(); }

  /// Collective: tells the others where this rank's side is, and opens theirs. This rank's device is current.
  /// @throws Error(device_error) on all ranks, where a GPU does not reach another one's memory
  void open(const SideAddresses<T>& mine);
  /// Ends what open() has opened, before the others give the memory back.
  void close() noexcept;
  /// By rank; null pointers for those of other machines (Link::machine_of).
  [[nodiscard]] const std::vector<SideAddresses<T>>& sides() const { return sides_; }

 private:
  // One array, as another process opens it.
  struct Array {
    cudaIpcMemHandle_t handle;
    std::uint64_t address;  // 0: there is none
  };
  // In the order of arrays_of().
  struct Record {
    std::uint64_t process;  // a number that no other process has
    std::int64_t device;
    Array arrays[8];
  };

  template <class Use>
  static void for_arrays(SideAddresses<T>& side, Use&& use);
  /// @param exported  others open the arrays
  [[nodiscard]] static Record record_of(SideAddresses<T> side, int device, bool exported);
  [[nodiscard]] bool is_near(int rank) const;
  void expect_own_device(const Record& record, const Record& mine, int rank) const;
  void open_from(const Record& record, const Record& mine, int rank);

  ranks::Link& link_;
  int device_;
  std::vector<SideAddresses<T>> sides_;
  std::vector<void*> opened_;
};

}  // namespace espalier::device::cuda
