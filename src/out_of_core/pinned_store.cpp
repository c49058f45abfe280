#include "out_of_core/pinned_store.hpp"

#include <algorithm>
#include <system_error>
#include <utility>

namespace espalier::out_of_core {

PinnedStore::PinnedStore(std::byte* store, Offset bytes, Offset limit, Offset block, Calls calls)
    : store_(store), bytes_(bytes), limit_(limit), block_(block), calls_(std::move(calls)), from_(bytes) {}

PinnedStore::~PinnedStore() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
  for (Offset at = from_; at < bytes_; at += left_in_block(store_ + at)) calls_.unpin(store_ + at);
}

void PinnedStore::start() {
  if (started_ || limit_ <= 0 || bytes_ <= 0) return;
  started_ = true;
  try {
    thread_ = std::thread([this] { pin_all(); });
  } catch (const std::system_error&) {  // no more threads: everything goes through the ring
  }
}

bool PinnedStore::complete() {
  start();
  if (thread_.joinable()) thread_.join();
  return from_ == 0;
}

// A failure of the driver shows up where the devices are used; here it means the ring.
void PinnedStore::pin_all() {
  try {
    calls_.enter();
    for (Offset end = bytes_; end > 0 && !stop_;) {
      const Offset at = (end - 1) / block_ * block_;
      if (bytes_ - at > limit_ || !calls_.pin(store_ + at, end - at)) return;
      from_.store(at, std::memory_order_release);
      end = at;
    }
  } catch (const Error&) {
  }
}

}  // namespace espalier::out_of_core
