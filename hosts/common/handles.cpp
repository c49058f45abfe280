#include "common/handles.hpp"

#include <pthread.h>

namespace espalier::hosts {

std::mutex& table_lock() {
  // Never destroyed: hosts end their handles when the process ends, in any order.
  static auto& lock = *new std::mutex;
  static const int registered = ::pthread_atfork([] { lock.lock(); }, [] { lock.unlock(); }, [] { lock.unlock(); });
  static_cast<void>(registered);
  return lock;
}

}  // namespace espalier::hosts
