#include "base/forks.hpp"

#include <pthread.h>

#include <atomic>

namespace espalier::base {

std::uint64_t forks() {
  static std::atomic<std::uint64_t> count{0};
  static const int refused = ::pthread_atfork(nullptr, nullptr, [] { count.fetch_add(1, std::memory_order_relaxed); });
  (void)refused;  // for want of memory: then a child is taken for its parent
  return count.load(std::memory_order_relaxed);
}

}  // namespace espalier::base
