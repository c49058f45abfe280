/// \file
/// One thread at a time inside an object, without Python's global lock: what solvers, simulations and systems share.
#pragma once

#include <nanobind/nanobind.h>

#include <atomic>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <type_traits>
#include <utility>

#include "c/handle.hpp"
#include "host.hpp"

namespace espalier::python {

class Turns {
 public:
  /// @param from_inside  what the thread is told that is inside a call and makes another one (from a callback)
  explicit Turns(const char* from_inside) : from_inside_(from_inside) {}

  /// Runs `body` (returns a value) without the global lock, when it is this thread's turn. Afterwards raises what
  /// Python raised meanwhile in callbacks.
  /// @throws std::logic_error in a thread that is inside already; where a thread was inside at a fork of the process
  template <class Body>
  std::invoke_result_t<Body> call(Body&& body) {
    if (inside()) throw std::logic_error(from_inside_);
    std::invoke_result_t<Body> result;
    if (!enter([&] { result = body(); }))
      throw std::logic_error(
          "another thread was inside a call on this object when the process forked; make a new one here");
    if (Host::raised) std::rethrow_exception(std::exchange(Host::raised, nullptr));
    return result;
  }

  /// As call(), for looks that callbacks of a call may take, too.
  template <class Body>
  std::invoke_result_t<Body> query(Body&& body) {
    return inside() ? body() : call(body);
  }

  /// As call() for a body without a value; false and nothing done where a thread was inside at a fork.
  template <class Body>
  bool enter(Body&& body) {
    if (inside()) throw std::logic_error(from_inside_);
    const nb::gil_scoped_release released;
    if (!callers_.enter()) return false;
    const solver::Inside counted(callers_);
    const std::lock_guard lock(mutex_);
    owner_ = std::this_thread::get_id();
    struct Leave {
      std::atomic<std::thread::id>& owner;
      ~Leave() { owner = std::thread::id{}; }
    } const leave{owner_};
    body();
    return true;
  }

 private:
  [[nodiscard]] bool inside() const { return owner_.load() == std::this_thread::get_id(); }

  const char* from_inside_;
  solver::Callers callers_;
  std::mutex mutex_;
  std::atomic<std::thread::id> owner_{};
};

}  // namespace espalier::python
