/// \file
/// What a rank's kernels find where memory of other machines would be. For this backend alone: needs the CUDA runtime.
#pragma once

#include <memory>
#include <vector>

#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/tables/copy_thread.hpp"
#include "device/cuda/tables/tile_exchange.hpp"

namespace espalier::device::cuda {

/// A stream each way; marks are events.
class CopyStreams final : public CopyQueues {
 public:
  explicit CopyStreams(std::size_t events);
  void copy(Way way, const Rectangle& what) override;
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
  MirroredMemory(ranks::Link& link, const ranks::Machines& machines, const plan::Plan& plan, Kind kind,
                 const DevicePlan& tables, int device, DeviceBudget& budget);

  /// Puts mirrors where `sides` has ranks of other machines. @param mine  this rank's
  void connect(const SideAddresses<T>& mine, std::vector<SideAddresses<T>>& sides);
  [[nodiscard]] TileExchange<T>& exchange() { return exchange_; }
  /// See TileExchange.
  void begin_solve(const SideAddresses<T>& mine, Index pass);

 private:
  Offset n_;
  CopyStreams queues_;
  CopyThread thread_;
  TileExchange<T> exchange_;
  ExchangeMemory<T> memory_;
  PinnedArray<int> flags_, control_, ones_;
  std::vector<DeviceArray<T>> places_;  // by rank; of those of other machines
};

}  // namespace espalier::device::cuda
