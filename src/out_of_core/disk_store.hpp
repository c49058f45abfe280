/// \file
/// The host's store of a factorization out of core where the host's memory is too small for it: a window of it is in
/// memory, the rest in a file.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/memory.hpp"
#include "base/scratch_file.hpp"
#include "espalier/types.hpp"

namespace espalier::out_of_core {

struct DiskOptions {
  std::string folder;       ///< empty: there is none
  Offset window_bytes = 0;  ///< of memory
  Offset block_bytes = 0;   ///< of one read or write, a multiple of 4096; 0: by the window
};

/// What a store does with the disk.
struct DiskTraffic {
  Offset written_bytes = 0, read_bytes = 0;
  double write_seconds = 0, read_seconds = 0;  ///< of all threads that write, or read, together
};

/// Bytes [at, at + bytes) of a store.
struct StoreRange {
  Offset at = 0, bytes = 0;
};

/// One use of a store in a plan.
struct StoreUse {
  Index step = 0;  ///< rising
  bool write = false;
  StoreRange range;
};

/// What a plan's run would move if a store had such a window: Belady's rule on blocks, as DiskStore keeps to it.
DiskTraffic traffic_of(const std::vector<StoreUse>& uses, Offset store_bytes, Offset lasts, Offset window_bytes);

/// Memory with fixed addresses, of which blocks come and go. Blocks that are not held stay until others need their
/// memory; then those go whose next use is farthest (Belady 1966). Those of later uses are read ahead, those of far
/// ones are written behind, by threads that live from begin to end of a *run*: a factorization, or one way of a solve.
/// A block that went to the disk has a checksum, which must be that of what comes back.
class DiskStore {
 public:
  enum class Access { read, write };

  /// @param bytes  of the store
  /// @param budget  the window is counted there; may be null
  /// @throws Error(out_of_memory) where the window, or the folder, has too little room; Error(invalid_input) for a
  /// folder that takes no files
  DiskStore(Offset bytes, const DiskOptions& options, base::MemoryBudget* budget);
  ~DiskStore();
  DiskStore(const DiskStore&) = delete;
  DiskStore& operator=(const DiskStore&) = delete;

  [[nodiscard]] std::byte* data() { return memory_; }
  [[nodiscard]] Offset bytes() const { return bytes_; }
  [[nodiscard]] Offset block_bytes() const { return block_; }
  [[nodiscard]] Offset window_bytes() const { return static_cast<Offset>(frames_) * block_; }
  /// The size of blocks for a window.
  static Offset block_for(Offset window_bytes);

  /// The plan of the runs to come; ends the run at hand. @param uses  by rising steps
  /// @param lasts  what stands before this byte is of use after a run, in rising order
  /// @param queues  that carry it out side by side
  /// @param steps  in all
  void set_plan(std::vector<StoreUse> uses, Offset lasts, int queues, Index steps);
  [[nodiscard]] Index plan_steps() const { return end_step_; }
  /// A run of the plan begins. @param keep  what is there stays; else it is all forgotten
  void begin_plan(bool keep = false);
  /// One of its queues has come to this step, which is past all steps where it has ended.
  void at_step(int queue, Index step);
  static constexpr Index kEnd = INT32_MAX;

  /// A run begins that reads these parts one after another; the next one reads them the other way round.
  void begin_parts(std::vector<StoreRange> parts);
  /// Waits until a part is in memory, where it stays until release_part(). Parts must be released in about this order.
  void need_part(std::size_t part);
  void release_part(std::size_t part);

  /// Whoever waits, or will, during this run gets GivenUp.
  void give_up() noexcept;
  /// Ends a run. What failed in it does not matter to the next one.
  void end() noexcept;

  /// During a plan's run: use(address, place in the range, bytes) for the pieces of a range, each within a block that
  /// is in memory meanwhile. From any thread. @throws Error of the disk
  template <class Use>
  void each_piece(Offset at, Offset bytes, Access access, Use&& use) {
    for (Offset done = 0; done < bytes;) {
      const Offset now = std::min(bytes - done, block_ - (at + done) % block_);
      const Held held(*this, at + done, now, access);
      use(memory_ + at + done, done, now);
      done += now;
    }
  }
  /// Brings all of [0, bytes) to memory until the next run begins. @throws Error(out_of_memory) where it is larger than
  /// the window
  void hold_all(Offset bytes);

  /// Since the store was made.
  [[nodiscard]] DiskTraffic traffic() const;

 private:
  static constexpr Index kNever = INT32_MAX;
  static constexpr int kReaders = 2, kWriters = 4;  // threads
  enum class State : char { empty, in_memory, reading, on_disk };
  struct Block {
    State state = State::empty;
    bool dirty = false;    // its memory is newer than the file
    bool writing = false;  // to the file, from its memory
    std::int32_t pins = 0;
    Index first = kNever, last = -1;  // parts that read it, of the run at hand
    std::uint64_t checksum = 0;       // of what is in the file
  };
  class Held {
   public:
    Held(DiskStore& store, Offset at, Offset bytes, Access access) : store_(store), block_(at / store.block_) {
      store_.hold(block_, access, at % store.block_ == 0 && bytes == store.block_size(block_));
    }
    ~Held() { store_.release(block_); }
    Held(const Held&) = delete;
    Held& operator=(const Held&) = delete;

   private:
    DiskStore& store_;
    Offset block_;
  };
  using Lock = std::unique_lock<std::mutex>;

  [[nodiscard]] Block& block(Offset b) { return blocks_[static_cast<std::size_t>(b)]; }
  [[nodiscard]] const Block& block(Offset b) const { return blocks_[static_cast<std::size_t>(b)]; }
  [[nodiscard]] std::byte* address(Offset b) { return memory_ + b * block_; }
  [[nodiscard]] Offset block_size(Offset b) const { return std::min(block_, reserved_ - b * block_); }
  [[nodiscard]] Offset first_block(const StoreRange& r) const { return r.at / block_; }
  [[nodiscard]] Offset end_block(const StoreRange& r) const { return (r.at + r.bytes + block_ - 1) / block_; }
  [[nodiscard]] Index now() const;
  [[nodiscard]] Index next_use(Offset b) const;
  [[nodiscard]] bool has_later_read(Offset b) const;

  void hold(Offset b, Access access, bool whole);
  void release(Offset b);
  void wait(Lock& lock);
  void tell_all();
  void check_failure() const;
  void start_threads();
  void guarded(const std::function<void()>& work);
  void read_ahead();
  void read_parts(Lock& lock);
  void read_plan(Lock& lock);
  void write_behind();
  bool take_frame(Index after);
  void drop(Offset b);
  void map(Offset b);
  [[nodiscard]] Offset farthest(bool dirty, Index after) const;
  void read_block(Lock& lock, Offset b);
  void write_block(Lock& lock, Offset b);

  const Offset bytes_;
  Offset block_ = 0, reserved_ = 0;
  std::int64_t frames_ = 0, used_frames_ = 0;
  base::BudgetShare share_;
  void* mapped_ = nullptr;
  std::byte* memory_ = nullptr;
  std::unique_ptr<base::ScratchFile> file_;
  std::vector<Block> blocks_;
  std::vector<Offset> in_memory_;  // blocks that take a frame
  std::uint64_t forks_;

  // The run at hand.
  enum class Run : char { none, plan, parts } run_ = Run::none;
  std::vector<Index> steps_;                // queues
  std::vector<StoreUse> uses_;              // of a plan
  std::vector<std::vector<Index>> use_at_;  // blocks; steps of a plan that use them
  std::vector<Index> last_read_;            // blocks
  Offset lasts_ = 0;
  Index end_step_ = 0;
  std::size_t next_use_ = 0;  // of uses_, to be read ahead
  std::vector<StoreRange> parts_;
  std::vector<char> part_state_;  // 1: held; 2: released
  std::size_t next_part_ = 0, released_ = 0;
  Offset next_of_part_ = 0;  // blocks of it that are held

  mutable std::mutex mutex_;
  std::condition_variable changed_;  // for those who use the store
  std::condition_variable work_;     // for those who read and write it
  int waiting_ = 0;                  // for changed_
  std::vector<std::thread> threads_;
  bool stop_ = false;
  std::exception_ptr failure_;
  DiskTraffic traffic_;
};

}  // namespace espalier::out_of_core
