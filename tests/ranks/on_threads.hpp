/// \file
/// Runs a program on ranks that are threads of this process.
#pragma once

#include <functional>
#include <thread>
#include <vector>

#include "espalier/ranks.hpp"
#include "ranks/thread_ranks.hpp"

namespace espalier::ranks {

/// body(ranks) on each of `count` ranks at the same time.
inline void on_threads(int count, const Faults& faults, const std::function<void(const Ranks&)>& body,
                       double patience = 60) {
  const ThreadRanks shared(count, faults);
  std::vector<std::thread> threads;
  for (int r = 0; r < count; ++r) threads.emplace_back([&, r] { body(Ranks(shared.table(r), patience)); });
  for (std::thread& t : threads) t.join();
}

}  // namespace espalier::ranks
