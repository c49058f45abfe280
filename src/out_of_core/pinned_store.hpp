/// \file
/// The host's store, page-locked block by block while the program goes on, so that devices reach it without the ring.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <thread>

#include "espalier/types.hpp"

namespace espalier::out_of_core {

/// Through the ring every byte crosses the host's memory three times, straight into the store once; but page-locking
/// takes as long as moving the same bytes several times does, so that it pays for those who factor again. It goes
/// from the end of the store to its beginning: there stand contributions and the largest fronts, which cross the link
/// most often.
class PinnedStore {
 public:
  struct Calls {
    std::function<void()> enter;                           ///< once by the thread
    std::function<bool(std::byte* at, Offset bytes)> pin;  ///< false: refused, and no more is asked for
    std::function<void(std::byte* at)> unpin;
  };

  /// Nothing is pinned yet. The store outlives this object.
  /// @param limit  bytes that may be pinned
  /// @param block  bytes of a block, a multiple of 64; other calls of the driver may have to wait for one
  PinnedStore(std::byte* store, Offset bytes, Offset limit, Offset block, Calls calls);
  PinnedStore(const PinnedStore&) = delete;
  PinnedStore& operator=(const PinnedStore&) = delete;
  /// Ends the thread and releases all. @pre no copy is on its way
  ~PinnedStore();

  /// Starts the thread; again: nothing.
  void start();
  /// Waits until the thread is done. @returns whether all of the store is pinned
  bool complete();
  /// Bytes at the end of the store that are pinned by now.
  [[nodiscard]] Offset pinned_bytes() const { return bytes_ - from_.load(std::memory_order_acquire); }
  /// Whether bytes [at, at + bytes) of the store are.
  [[nodiscard]] bool holds(const std::byte* at, Offset bytes) const {
    const Offset begin = at - store_;
    return begin >= from_.load(std::memory_order_acquire) && begin + bytes <= bytes_;
  }
  /// Bytes from `at` to the end of its block: a copy ends there at the latest.
  [[nodiscard]] Offset left_in_block(const std::byte* at) const { return block_ - (at - store_) % block_; }

 private:
  void pin_all();

  std::byte* const store_;
  const Offset bytes_, limit_, block_;
  const Calls calls_;
  std::atomic<Offset> from_;  // the store is pinned from here on
  std::atomic<bool> stop_{false};
  bool started_ = false;
  std::thread thread_;
};

}  // namespace espalier::out_of_core
