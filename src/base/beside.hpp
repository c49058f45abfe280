/// \file
/// Work beside the caller's, on a thread of its own.
#pragma once

#include <future>
#include <system_error>
#include <type_traits>
#include <utility>

namespace espalier::base {

/// Starts `work` on a new thread; where `wanted` is false, or there is none to be had, get() does the work.
template <class Work>
std::future<std::invoke_result_t<std::decay_t<Work>>> start_beside(Work&& work, bool wanted = true) {
  if (wanted) {
    try {
      return std::async(std::launch::async, work);
    } catch (const std::system_error&) {  // the machine has no more threads
    }
  }
  return std::async(std::launch::deferred, std::forward<Work>(work));
}

}  // namespace espalier::base
