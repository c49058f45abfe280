/// \file
/// Arrays of other processes on this machine, opened by CUDA IPC. For this backend alone: needs the CUDA runtime.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <string>
#include <vector>

#include "device/cuda/executor/device_side.hpp"
#include "ranks/communicator.hpp"
#include "ranks/machines.hpp"

namespace espalier::device::cuda {

/// Arrays that ranks of a machine reach of each other. Ranks are processes, each with a GPU, or threads of one
/// process with different GPUs.
///
/// The memory of a rank that has died stays mapped as long as this object lives.
class OpenedArrays {
 public:
  /// @param device  of this rank
  OpenedArrays(ranks::Communicator& link, const ranks::Machines& machines, int device)
      : link_(link), machines_(machines), device_(device) {}
  OpenedArrays(const OpenedArrays&) = delete;
  OpenedArrays& operator=(const OpenedArrays&) = delete;
  ~OpenedArrays() { close(); }

  /// Collective: tells the others where this rank's arrays are, and opens theirs. This rank's device is current.
  /// @param mine  as many on each rank; null: there is none. Each begins an allocation of whole pages (whole_pages())
  /// @throws Error(device_error) on all ranks, where a GPU does not reach another one's memory
  void open(const std::vector<void*>& mine);
  /// Ends what open() has opened, before the others give the memory back.
  void close() noexcept;
  /// By rank, in the order of open(); null pointers for those of other machines.
  [[nodiscard]] const std::vector<std::vector<void*>>& arrays() const { return arrays_; }

 private:
  // One array, as another process opens it.
  struct Array {
    std::uint64_t process;  // a number that no other process has
    std::int64_t device;
    std::uint64_t address;  // 0: there is none
    cudaIpcMemHandle_t handle;
  };
  [[nodiscard]] Array record_of(void* array) const;
  [[nodiscard]] void* open_from(const Array& theirs, int rank);

  ranks::Communicator& link_;
  ranks::Machines machines_;
  int device_;
  std::vector<std::vector<void*>> arrays_;
  std::vector<void*> opened_;
};

/// What ranks reach of each other's sides. After a rank has died nobody sets its flags any more.
template <class T>
class ReachedMemory {
 public:
  ReachedMemory(ranks::Communicator& link, const ranks::Machines& machines, int device)
      : opened_(link, machines, device) {}

  /// See OpenedArrays.
  void open(const SideAddresses<T>& mine);
  void close() noexcept;
  /// By rank; of no use for those of other machines.
  [[nodiscard]] const std::vector<SideAddresses<T>>& sides() const { return sides_; }

 private:
  OpenedArrays opened_;
  std::vector<SideAddresses<T>> sides_;
};

}  // namespace espalier::device::cuda
