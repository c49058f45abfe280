/// \file
/// Objects that hosts hold by a pointer whose meaning they do not know.
#pragma once

#include <memory>
#include <mutex>
#include <unordered_map>

namespace espalier::hosts {

/// A lock that the child of a fork() finds open, whatever the parent's threads were doing. One for all tables of a
/// library; held for the time of a look-up alone.
std::mutex& table_lock();

/// The live objects of one kind. A pointer that is no handle of it (never set by the host, or ended before) is told
/// from one that is; an object that is ended while another thread works with it lives until that thread is done.
template <class T>
class Handles {
 public:
  void* add(std::shared_ptr<T> object) {
    void* const handle = object.get();
    const std::lock_guard lock(table_lock());
    objects_[handle] = std::move(object);
    return handle;
  }
  /// For an object that stands behind a pointer of the real library.
  void add(const void* handle, std::shared_ptr<T> object) {
    const std::lock_guard lock(table_lock());
    objects_[handle].swap(object);
  }
  /// Null for what is no handle.
  std::shared_ptr<T> find(const void* handle) const {
    const std::lock_guard lock(table_lock());
    const auto found = objects_.find(handle);
    return found == objects_.end() ? nullptr : found->second;
  }
  /// Nothing happens for what is no handle.
  void end(const void* handle) {
    std::shared_ptr<T> last;  // its end may take long: after the lock
    const std::lock_guard lock(table_lock());
    const auto found = objects_.find(handle);
    if (found == objects_.end()) return;
    last.swap(found->second);
    objects_.erase(found);
  }

 private:
  std::unordered_map<const void*, std::shared_ptr<T>> objects_;
};

}  // namespace espalier::hosts
