/// \file
/// Messages between running kernels of different machines. For this backend alone: needs the CUDA runtime.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <vector>

#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/executor/pinned_slots.hpp"
#include "device/cuda/tables/tile_messages.hpp"
#include "ranks/link.hpp"

namespace espalier::device::cuda {

/// What kernels hand to ranks whose GPUs they do not reach. The kernels are those of GPUs that reach each other; only
/// the addresses differ. Where another machine's memory would be, they find *mirrors*:
///
/// - its copy of the top is this GPU's own, which so is written twice with the same;
/// - its flags lie on this host, where the calling thread sees which tiles are finished;
/// - the contributions that it makes have memory here, into which they are copied when they come.
///
/// The calling thread looks at the flags in the order of tasks, has a copy engine bring what is finished to the host,
/// neighbours together, and posts it. What comes from others a copy engine brings into place, and then, in the same
/// stream, the flags, for which the running kernels wait. In a solve, updates are their own flags: an element that is
/// there is not the pattern that memory was filled with.
///
/// All calls with this rank's device current, by the thread that calls the solver.
template <class T>
class TileExchange {
 public:
  /// @param tables  made as mirrored; outlives this object, as do link and plan
  TileExchange(ranks::Link& link, const plan::Plan& plan, Kind kind, const DevicePlan& tables);
  TileExchange(const TileExchange&) = delete;
  TileExchange& operator=(const TileExchange&) = delete;
  ~TileExchange();

  /// Memory for what comes from others. @throws Error(out_of_memory)
  void take_memory(DeviceBudget& budget);
  /// Puts mirrors where `sides` has ranks of other machines. @param mine  this rank's
  void mirror(const SideAddresses<T>& mine, std::vector<SideAddresses<T>>& sides);

  /// Before the kernels of a run are launched; nobody's kernels run. @param pass  right-hand sides
  void begin_factor();
  void begin_solve(Index pass);
  /// Sends and receives until the kernels are done and nothing is missing, here or at others from here.
  /// @param kernels_done  asked again and again
  /// @throws Error(device_error) when kernels have given up, or as Link::drive()
  void run(const std::function<bool()>& kernels_done);
  /// After a failure, when the kernels have ended.
  void give_up() noexcept;

 private:
  enum MessageKind : std::int32_t { kTiles = 1, kUpdates = 2 };
  /// A part of a vector of updates that goes as one message.
  struct Part {
    std::int64_t first = 0;  // element of the updates of a pass
    std::int64_t count = 0;
    std::uint16_t receivers = 0;
  };
  /// A copy under way, with the message from or into which it goes.
  struct Copying {
    std::size_t event;
    ranks::Message message;
    std::uint16_t receivers;
    std::size_t part;  // of parts_ whose completeness is to be looked at
  };

  [[nodiscard]] T* base_of(Piece::Array array, int maker) const;
  [[nodiscard]] bool is_apart(int rank) const { return (apart_ >> rank & 1) != 0; }
  [[nodiscard]] ranks::Message new_message(std::size_t bytes, std::int32_t kind, std::int64_t first,
                                           std::int32_t count);
  [[nodiscard]] bool has_room() const { return slots_->left() > kKept; }
  std::size_t record(const Stream& stream);
  [[nodiscard]] bool is_done(std::size_t event) const;
  void copy_piece(const Piece& piece, int maker, std::byte* body, bool out, const Stream& stream) const;

  void take(int from, const ranks::Message& message);
  void take_tiles(int from, const ranks::Message& message);
  void take_updates(int from, const ranks::Message& message);
  void look_for_tiles();
  void send_tiles(std::size_t first, std::size_t last);
  void look_for_updates();
  void finish_copies();
  void post(const Copying& sent);
  [[nodiscard]] bool is_complete(const ranks::Message& message) const;
  [[nodiscard]] std::vector<Part> parts_of(int rank, Index pass) const;
  [[nodiscard]] bool nothing_missing() const { return unsent_ == 0 && missing_ == 0 && in_.empty() && out_.empty(); }
  void begin(bool factor);

  static constexpr std::size_t kSlots = 512, kSlotBytes = std::size_t{256} << 10;
  static constexpr std::size_t kKept = kSlots / 4;  // slots that are left for what comes
  static constexpr std::size_t kWindow = 1024;      // unfinished tiles that are looked at
  static constexpr std::size_t kPartsAtOnce = 16;   // parts of updates that are looked at

  ranks::Link& link_;
  const plan::Plan& plan_;
  Kind kind_;
  const DevicePlan& tables_;
  TileMessages messages_;
  std::uint32_t apart_ = 0;  // bit r: rank r is on another machine
  std::shared_ptr<PinnedSlots> slots_;
  Stream sending_, receiving_;
  PinnedArray<int> flags_;    // mirror: of all ranks of other machines
  PinnedArray<int> control_;  // likewise: counters of a factorization, then of a solve
  PinnedArray<int> ones_;
  std::vector<DeviceArray<T>> places_;  // by rank; of those of other machines
  std::vector<T*> place_starts_;
  SideAddresses<T> mine_;

  bool factor_ = false;  // the run is a factorization
  Index pass_ = 1;
  std::vector<char> sent_;  // tiles or parts
  std::size_t first_unsent_ = 0;
  std::int64_t unsent_ = 0, missing_ = 0;  // tiles or parts: not posted yet, not received yet
  std::vector<std::vector<Part>> parts_;   // by rank, of parts_pass_
  Index parts_pass_ = 0;
  std::deque<Copying> in_, out_;
  std::vector<std::unique_ptr<Event>> events_;
  std::vector<std::size_t> free_events_;
};

}  // namespace espalier::device::cuda
