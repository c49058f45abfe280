/// \file
/// What a rank's kernels find where memory of other machines would be. For this backend alone: needs the CUDA runtime.
#pragma once

#include <memory>
#include <vector>

#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/executor/reached_memory.hpp"
#include "device/cuda/tables/copy_thread.hpp"
#include "device/cuda/tables/tile_exchange.hpp"

namespace espalier::device::cuda {

/// A stream each way; marks are events.
class CopyStreams final : public CopyQueues {
 public:
  explicit CopyStreams(std::size_t events);
  void copy(Way way, const Rectangle& what) override;
  void pass_on(const PassedOn& what) override;
  std::uint64_t mark(Way way) override;
  bool is_done(std::uint64_t mark) override;
  void finish() noexcept override;

 private:
  [[nodiscard]] const Stream& stream(Way way) const { return streams_[way == Way::to_host ? 0 : 1]; }
  void add_event();

  Stream streams_[2];
  std::vector<std::unique_ptr<Event>> events_;
  std::vector<std::uint64_t> free_;
};

/// The mirrors, and the exchange that stands behind them (tile_exchange.hpp). This rank's device is current in all
/// calls.
template <class T>
class MirroredMemory {
 public:
  /// @param tables  made as mirrored; outlives this object, as do link and plan
  /// @throws Error(out_of_memory)
  MirroredMemory(ranks::Communicator& link, const ranks::Machines& machines, const plan::Plan& plan, Kind kind,
                 const DevicePlan& tables, int device, DeviceBudget& budget);

  /// Collective: what comes from other machines is brought into place by any rank of this one. Before connect().
  void open() { reached_.open({places_.data()}); }
  /// Puts mirrors where `sides` has ranks of other machines.
  void connect(std::vector<SideAddresses<T>>& sides);
  [[nodiscard]] TileExchange<T>& exchange() { return exchange_; }
  /// See TileExchange. @param sides  as connect() has left them
  void begin_solve(const std::vector<SideAddresses<T>>& sides, Index pass);

 private:
  int rank_;
  Offset n_;
  CopyStreams queues_;
  CopyThread thread_;
  TileExchange<T> exchange_;
  ExchangeMemory<T> memory_;
  PinnedArray<int> flags_, control_, ones_;
  DeviceArray<T> places_;  // ExchangeSide::mirrored
  OpenedArrays reached_;   // those of the others here; closed before
};

}  // namespace espalier::device::cuda
