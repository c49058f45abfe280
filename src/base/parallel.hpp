/// \file
/// Loops that run on a pool where there is one and on the calling thread where there is none, over the same ranges.
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/thread_pool.hpp"

namespace espalier::base {

/// body(begin, end) over ranges of [0, n) of at most `grain` indices. The ranges do not depend on `pool` (may be null).
template <class Body>
void for_each_range(ThreadPool* pool, std::int64_t n, std::int64_t grain, const Body& body) {
  if (pool != nullptr) {
    pool->for_each_range(n, grain, body);
  } else {
    for (std::int64_t begin = 0; begin < n; begin += grain) body(begin, std::min(n, begin + grain));
  }
}

/// body(i) for each i in [0, n), each as a task of its own.
template <class Body>
void for_each(ThreadPool* pool, std::int64_t n, const Body& body) {
  for_each_range(pool, n, 1, [&](std::int64_t begin, std::int64_t) { body(begin); });
}

/// Threads that for_each() will use.
inline int threads_of(const ThreadPool* pool) { return pool == nullptr ? 1 : pool->size(); }

}  // namespace espalier::base
