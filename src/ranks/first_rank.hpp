/// \file
/// What the first rank does for all of them.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "base/thread_pool.hpp"
#include "ranks/communicator.hpp"

namespace espalier::ranks {

/// The first rank does `work`, the others wait. It does so on a thread of its own, so that the one that calls gives
/// signs of life and asks whether to go on (`pool`'s interruption); the work may use the pool. Collective.
/// @throws Error on all ranks: what the work throws
void by_first_rank(Communicator& link, base::ThreadPool& pool, const std::function<void()>& work);

/// Threads for the first rank's work: as many as all ranks have that may use the same cores, since the others wait.
class FirstRankPool {
 public:
  /// @param own  of this rank; outlives the object, and is all there is on other ranks
  FirstRankPool(const Communicator& link, base::ThreadPool& own);
  [[nodiscard]] base::ThreadPool& get() { return more_ ? *more_ : own_; }

 private:
  base::ThreadPool& own_;
  std::optional<base::ThreadPool> more_;
};

/// The bytes that the first rank has, on all ranks. What the others give is not looked at. Collective.
std::vector<std::byte> from_first_rank(Communicator& link, std::span<const std::byte> mine);

}  // namespace espalier::ranks
