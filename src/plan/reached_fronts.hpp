/// \file
/// Which fronts other values of the matrix reach.
#pragma once

#include <cstring>
#include <span>
#include <vector>

#include "base/at.hpp"
#include "base/thread_pool.hpp"
#include "plan/plan.hpp"

namespace espalier::plan {

/// Whether entries of A in the front have other values, bit by bit.
/// @param values, before  of the plan's entries
template <class T>
bool entries_differ(const Plan& plan, Index f, std::span<const T> values, std::span<const T> before) {
  const Offset begin = plan.entry_ptr[at(plan.first_tile[at(f)])], end = plan.entry_ptr[at(plan.first_tile[at(f) + 1])];
  for (Offset k = begin; k < end; ++k) {
    const std::size_t source = at(plan.entries[at(k)].source());
    // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): bits are what counts
    if (std::memcmp(&values[source], &before[source], sizeof(T)) != 0) return true;
  }
  return false;
}

/// Fronts; 1: it or one below it has entries with other values.
template <class T>
std::vector<char> fronts_reached(const Plan& plan, std::span<const T> values, std::span<const T> before,
                                 base::ThreadPool& pool) {
  constexpr std::int64_t kFronts = 64;
  std::vector<char> reached(at(plan.fronts()), 0);
  pool.for_each_range(plan.fronts(), kFronts, [&](std::int64_t begin, std::int64_t end) {
    for (auto f = static_cast<Index>(begin); f < end; ++f)
      reached[at(f)] = entries_differ(plan, f, values, before) ? 1 : 0;
  });
  for (Index f = 0; f < plan.fronts(); ++f)  // children stand before their parents
    if (const Index parent = plan.tree.parent[at(f)]; parent >= 0 && reached[at(f)] != 0) reached[at(parent)] = 1;
  return reached;
}

/// Operations for these fronts over those for all.
double share_of_work(const Plan& plan, std::span<const char> fronts);

}  // namespace espalier::plan
