/// \file
/// Messages between running kernels of different machines. As plain C++: what copies is given by the executor.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "device/cuda/tables/copy_queues.hpp"
#include "device/cuda/tables/landing.hpp"
#include "device/cuda/tables/message_slots.hpp"
#include "device/cuda/tables/tile_messages.hpp"
#include "ranks/communicator.hpp"
#include "ranks/machines.hpp"

namespace espalier::device::cuda {

/// What an exchange reads and writes on the device of a rank, its own or one that its device reaches.
template <class T>
struct ExchangeSide {
  T* top = nullptr;       ///< region 0
  T* pivots = nullptr;    ///< FactorState::pivot, inverse_d, inverse_e
  T* updates = nullptr;   ///< of a pass of a solve
  T* places = nullptr;    ///< of the contributions that this rank makes: Place::offset counts from here
  T* mirrored = nullptr;  ///< of those of other machines, see TileExchange::mirrored_at()
  int* flags = nullptr;   ///< for which its kernels wait
};

/// Where an exchange reads and writes.
template <class T>
struct ExchangeMemory {
  std::vector<ExchangeSide<T>> sides;  ///< by rank; those of other machines have no meaning
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
/// Each message goes to one rank of each other machine that needs it (landing.hpp). That rank's copy engine brings it
/// into place on its own device, and from there on those of its machine; the others see nothing of it but their flags.
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
  TileExchange(ranks::Communicator& link, const ranks::Machines& machines, const plan::Plan& plan, Kind kind,
               const DevicePlan& tables, CopyQueues& queues);
  TileExchange(const TileExchange&) = delete;
  TileExchange& operator=(const TileExchange&) = delete;
  ~TileExchange();

  /// Bit r: rank r is on another machine.
  [[nodiscard]] std::uint32_t apart() const { return landing_.apart(); }
  /// Elements of ExchangeSide::mirrored, and where in it the contributions of a rank of another machine are: alike on
  /// all ranks of this machine.
  [[nodiscard]] std::int64_t mirrored_size() const { return mirrored_at_.back(); }
  [[nodiscard]] std::int64_t mirrored_at(int rank) const { return mirrored_at_[static_cast<std::size_t>(rank)]; }
  /// Bytes that a slot must hold.
  [[nodiscard]] std::size_t slot_bytes() const;
  /// Messages, those that come in as well, lie in these slots as long as there are any. Each run takes the link's
  /// receipts for them anew, as other exchanges on the link do for theirs.
  void use(std::shared_ptr<MessageSlots> slots);
  void use(const ExchangeMemory<T>& memory) { memory_ = memory; }

  /// Before the kernels of a run are launched; nobody's kernels run. @param pass  right-hand sides
  void begin_factor();
  void begin_solve(Index pass);
  /// Sends and receives until the kernels are done, nothing is missing in the memory of this rank, whoever brings it
  /// there, and nothing from here at others.
  /// @param kernels_done  asked again and again
  /// @throws Error(device_error) when kernels have given up, or as ChildRows::drive()
  void run(const std::function<bool()>& kernels_done);
  /// Bytes of an array that lies on all devices.
  struct Range {
    std::int64_t first = 0, count = 0;
  };
  /// Most bytes of a message of share().
  [[nodiscard]] std::int64_t largest_part() const { return static_cast<std::int64_t>(body_bytes()); }
  /// Each rank's range from its device to those of all ranks on other machines. Waits until what comes is there.
  /// @param arrays  by rank; those of other machines have no meaning
  /// @param ranges  by rank, the same on all. @throws as run()
  void share(std::span<std::byte* const> arrays, std::span<const Range> ranges);
  /// After a failure, when the kernels have ended.
  void give_up() noexcept;

 private:
  /// What a run brings, and the kind of its messages.
  enum class What : std::int32_t { tiles = 1, updates = 2, values = 3 };
  static constexpr std::int32_t kLanded = 4;  // the kind of a message that says so; its number is What
  /// A part of a vector of updates that goes as one message.
  struct UpdateMessage {
    std::int64_t first = 0;  // element of the updates of a pass
    std::int64_t count = 0;
    std::uint16_t receivers = 0;
  };
  /// A copy to the host, of which a message is made.
  struct Leaving {
    std::uint64_t mark;
    ranks::Message message;
    std::uint32_t receivers;
    std::size_t key;   // for their machines' landing ranks
    std::size_t part;  // of parts_, to be looked at for being complete
  };
  /// Copies to the device, of messages that came at a time.
  struct Coming {
    std::uint64_t mark;
    std::vector<ranks::Message> messages;
  };

  [[nodiscard]] const ExchangeSide<T>& side(int rank) const { return memory_.sides[static_cast<std::size_t>(rank)]; }
  [[nodiscard]] T* base_of(Piece::Array array, int maker, int rank) const;
  [[nodiscard]] ranks::Message new_message(std::size_t bytes, std::size_t first, std::size_t count);
  [[nodiscard]] std::size_t body_bytes() const {
    return slots_->bytes() - sizeof(ranks::Header);
  }                                                                                    // alike on all ranks
  [[nodiscard]] bool has_room() const { return slots_->left() > slots_->size() / 4; }  // the rest is for what comes
  void copy_piece(Way way, const Piece& piece, int maker, std::byte* body);
  void copy_list(Way way, void* device, const void* host, std::size_t bytes);
  void pass_on_piece(const Piece& piece, int maker, int to);
  void pass_on_list(const void* from, void* to, std::size_t bytes);

  void begin(What what, const Arrivals& due);
  [[nodiscard]] bool given_up() const;
  void take(int from, const ranks::Message& message);
  void take_tiles(int from, const ranks::Message& message);
  void take_updates(int from, const ranks::Message& message);
  void take_values(int from, const ranks::Message& message);
  void take_word(int from, const ranks::Message& message);
  [[nodiscard]] std::vector<int> beside(std::uint32_t receivers) const {
    return ranks_of(receivers & landing_.beside());
  }
  [[nodiscard]] Error other_calls(int rank) const;
  [[nodiscard]] Arrivals tiles_to_come() const;
  [[nodiscard]] Arrivals updates_to_come() const;
  [[nodiscard]] Arrivals values_to_come() const;
  [[nodiscard]] std::int64_t parts_of_values(int rank) const;
  /// For landing ranks. Row blocks of a column have one, as they go together.
  [[nodiscard]] static std::size_t key_of(const SentTile& tile) {
    return static_cast<std::size_t>(tile.task.front) + static_cast<std::size_t>(std::max(tile.task.column, 0));
  }
  [[nodiscard]] std::size_t key_of_values(int rank, std::int64_t at) const;
  void tell_landed();
  void look_for_values();
  void look_for_tiles();
  [[nodiscard]] bool is_finished(std::size_t tile) const;
  void send_from(std::size_t first);
  void look_for_updates();
  void finish_copies();
  [[nodiscard]] bool is_complete(const ranks::Message& message) const;
  [[nodiscard]] std::vector<UpdateMessage> parts_of(int rank, Index pass) const;
  // A message counts once, whoever has it still to come.
  [[nodiscard]] bool is_busy() const { return out_.size() + sending_.size() >= kAtOnce; }
  void forget_sent();
  [[nodiscard]] bool nothing_missing() const {
    return unsent_ == 0 && out_.empty() && sending_.empty() && due_.missing == 0 && in_.empty() &&
           due_.for_others == 0 && due_.from_others == 0;
  }

  static constexpr std::size_t kWindow = 1024;     // unfinished tiles that are looked at
  static constexpr std::size_t kAtOnce = 8;        // messages that leave; meanwhile tiles gather for longer ones
  static constexpr std::size_t kPartsAtOnce = 16;  // parts of updates that are looked at
  static constexpr int kRoundsOfKernels = 16;      // between two questions whether kernels have ended

  ranks::Communicator& link_;
  Kind kind_;
  const DevicePlan& tables_;
  TileMessages messages_;
  CopyQueues& queues_;
  Landing landing_;
  std::vector<std::int64_t> mirrored_at_;  // by rank, and the end
  std::shared_ptr<MessageSlots> slots_;
  ExchangeMemory<T> memory_;

  What what_ = What::tiles;
  std::vector<std::int64_t> flag_of_;  // by tile that this rank makes
  std::vector<char> sent_;             // tiles or parts
  std::size_t first_unsent_ = 0;
  std::int64_t unsent_ = 0;                        // tiles or parts that are not posted yet
  Arrivals due_;                                   // of what has still to come, to be told, and to be heard of
  Arrivals due_tiles_, due_updates_;               // at the beginning of each run; the second of parts_pass_
  std::vector<std::vector<UpdateMessage>> parts_;  // by rank, of parts_pass_
  Index parts_pass_ = 0;
  std::vector<ranks::Message> taken_;  // since the last mark
  std::deque<Coming> in_;
  std::deque<Leaving> out_;
  std::vector<std::weak_ptr<const std::byte[]>> sending_;  // messages that the link has
  std::span<std::byte* const> arrays_;                     // of share(), as these
  std::span<const Range> ranges_;
};

}  // namespace espalier::device::cuda
