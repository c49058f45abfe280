/// \file
/// Messages between running kernels of different machines. As plain C++: what copies is given by the executor.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "device/cuda/tables/copy_queues.hpp"
#include "device/cuda/tables/message_slots.hpp"
#include "device/cuda/tables/tile_messages.hpp"
#include "ranks/link.hpp"
#include "ranks/machines.hpp"

namespace espalier::device::cuda {

/// Where an exchange reads and writes. By rank: all lie with this rank.
template <class T>
struct ExchangeMemory {
  T* top = nullptr;            ///< of the device, as all that follow: region 0
  T* pivots = nullptr;         ///< FactorState::pivot, inverse_d, inverse_e
  T* updates = nullptr;        ///< of a pass of a solve
  std::vector<T*> places;      ///< by rank that makes contributions: Place::offset counts from here
  int* flags = nullptr;        ///< for which kernels here wait
  int* mirror = nullptr;       ///< of the host, as all that follow: flags that kernels here set for other machines
  int* control = nullptr;      ///< 2 x kCounters, likewise: they have given up
  const int* ones = nullptr;   ///< as many as a front has row blocks
  int aborted_at[2] = {0, 0};  ///< which of `control` says so, of a solve and of a factorization
};

/// Seconds that a block of a kernel waits for another one's, at the `patience` of a link: longer, so that a rank from
/// which nothing comes is named by the link.
[[nodiscard]] double patience_of_kernels(double patience);

/// What kernels hand to ranks whose GPUs they do not reach. The kernels are those of GPUs that reach each other; only
/// the addresses differ. Where another machine's memory would be, they find *mirrors*:
///
/// - its copy of the top is this GPU's own, which so is written twice with the same;
/// - its flags lie on this host, where the calling thread sees which tiles are finished;
/// - the contributions that it makes have memory here, into which they are copied when they come.
///
/// The calling thread looks at the flags in the order of tasks, has a copy engine bring what is finished to the host,
/// neighbours together, and posts it; diagonal tiles at once, others when no more than some messages are on their way,
/// so that they are the longer the more there is to do. What comes from others a copy engine brings into place, and
/// then, in the same queue, the flags, for which the running kernels wait. In a solve, updates are their own flags: an
/// element that is there is not the pattern that memory was filled with.
///
/// Values that one rank has been given go the same way, in parts, before the kernels run.
///
/// All calls by the thread that calls the solver. Nobody waits for room: what comes in always has some.
template <class T>
class TileExchange {
 public:
  static constexpr std::size_t kSlots = 256, kSlotBytes = std::size_t{1} << 20;

  /// All arguments outlive this object. @param tables  made as mirrored
  TileExchange(ranks::Link& link, const ranks::Machines& machines, const plan::Plan& plan, Kind kind,
               const DevicePlan& tables, CopyQueues& queues);
  TileExchange(const TileExchange&) = delete;
  TileExchange& operator=(const TileExchange&) = delete;
  ~TileExchange();

  /// Bit r: rank r is on another machine.
  [[nodiscard]] std::uint32_t apart() const { return apart_; }
  /// Bytes that a slot must hold.
  [[nodiscard]] std::size_t slot_bytes() const;
  /// Messages, those that come in as well, lie in these slots as long as there are any. Each run takes the link's
  /// receipts for them anew, as other exchanges on the link do for theirs.
  void use(std::shared_ptr<MessageSlots> slots);
  void use(const ExchangeMemory<T>& memory) { memory_ = memory; }

  /// Before the kernels of a run are launched; nobody's kernels run. @param pass  right-hand sides
  void begin_factor();
  void begin_solve(Index pass);
  /// Sends and receives until the kernels are done and nothing is missing, here or at others from here.
  /// @param kernels_done  asked again and again
  /// @throws Error(device_error) when kernels have given up, or as Link::drive()
  void run(const std::function<bool()>& kernels_done);
  /// Bytes of an array that lies on all devices, whose first is `array` here.
  struct Range {
    std::int64_t first = 0, count = 0;
  };
  /// Most bytes of a message of share().
  [[nodiscard]] std::int64_t largest_part() const { return static_cast<std::int64_t>(body_bytes()); }
  /// Each rank's range from its device to those of all ranks on other machines. Waits until what comes is there.
  /// @param ranges  by rank, the same on all. @throws as run()
  void share(std::byte* array, std::span<const Range> ranges);
  /// After a failure, when the kernels have ended.
  void give_up() noexcept;

 private:
  /// What a run brings, and the kind of its messages.
  enum class What : std::int32_t { tiles = 1, updates = 2, values = 3 };
  /// A part of a vector of updates that goes as one message.
  struct Part {
    std::int64_t first = 0;  // element of the updates of a pass
    std::int64_t count = 0;
    std::uint16_t receivers = 0;
  };
  /// A copy to the host, of which a message is made.
  struct Leaving {
    std::uint64_t mark;
    ranks::Message message;
    std::uint16_t receivers;
    std::size_t part;  // of parts_, to be looked at for being complete
  };
  /// Copies to the device, of messages that came at a time.
  struct Coming {
    std::uint64_t mark;
    std::vector<ranks::Message> messages;
  };

  [[nodiscard]] T* base_of(Piece::Array array, int maker) const;
  [[nodiscard]] ranks::Message new_message(std::size_t bytes, std::size_t first, std::size_t count);
  [[nodiscard]] std::size_t body_bytes() const {
    return slots_->bytes() - sizeof(ranks::Header);
  }                                                                                    // alike on all ranks
  [[nodiscard]] bool has_room() const { return slots_->left() > slots_->size() / 4; }  // the rest is for what comes
  void copy_piece(Way way, const Piece& piece, int maker, std::byte* body);
  void copy_list(Way way, void* device, const void* host, std::size_t bytes);

  void begin(What what);
  [[nodiscard]] bool given_up() const;
  void take(int from, const ranks::Message& message);
  void take_tiles(int from, const ranks::Message& message);
  void take_updates(int from, const ranks::Message& message);
  void take_values(int from, const ranks::Message& message);
  [[nodiscard]] Error other_calls(int rank) const;
  void look_for_values();
  void look_for_tiles();
  [[nodiscard]] bool is_finished(std::size_t tile) const;
  void send_from(std::size_t first);
  void look_for_updates();
  void finish_copies();
  [[nodiscard]] bool is_complete(const ranks::Message& message) const;
  [[nodiscard]] std::vector<Part> parts_of(int rank, Index pass) const;
  // A message counts once, whoever has it still to come.
  [[nodiscard]] bool is_busy() const { return out_.size() + sending_.size() >= kAtOnce; }
  void forget_sent();
  [[nodiscard]] bool nothing_missing() const { return unsent_ == 0 && missing_ == 0 && in_.empty() && out_.empty(); }

  static constexpr std::size_t kWindow = 1024;     // unfinished tiles that are looked at
  static constexpr std::size_t kAtOnce = 8;        // messages that leave; meanwhile tiles gather for longer ones
  static constexpr std::size_t kPartsAtOnce = 16;  // parts of updates that are looked at
  static constexpr int kRoundsOfKernels = 16;      // between two questions whether kernels have ended

  ranks::Link& link_;
  Kind kind_;
  const DevicePlan& tables_;
  TileMessages messages_;
  CopyQueues& queues_;
  std::uint32_t apart_ = 0;
  std::shared_ptr<MessageSlots> slots_;
  ExchangeMemory<T> memory_;

  What what_ = What::tiles;
  Index pass_ = 1;
  std::vector<std::int64_t> flag_of_;  // by tile that this rank makes
  std::vector<char> sent_;             // tiles or parts
  std::size_t first_unsent_ = 0;
  std::int64_t unsent_ = 0, missing_ = 0;  // tiles or parts: not posted yet, not received yet
  std::vector<std::vector<Part>> parts_;   // by rank, of parts_pass_
  Index parts_pass_ = 0;
  std::vector<ranks::Message> taken_;  // since the last mark
  std::deque<Coming> in_;
  std::deque<Leaving> out_;
  std::vector<std::weak_ptr<const std::byte[]>> sending_;  // messages that the link has
  std::byte* array_ = nullptr;                             // of share()
  std::span<const Range> ranges_;
};

}  // namespace espalier::device::cuda
