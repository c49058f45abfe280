/// \file
/// Where entries of an inverse stand in fronts.
#pragma once

#include <algorithm>
#include <atomic>
#include <utility>
#include <vector>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "device/executor.hpp"
#include "plan/plan.hpp"

namespace espalier::device {

/// Entries that are asked for, front by front, by rows of the front that has them.
struct InversePlaces {
  struct Place {
    Index row, col;
    Offset number;  ///< of the entry
  };
  std::vector<Offset> ptr;  ///< fronts + 1
  base::Buffer<Place> places;
};

/// The row of front f at which a position stands; -1: it is none of its rows.
inline Index row_in_front(const plan::Plan& plan, Index f, Index position) {
  const Index first = plan.tree.first[f], pivots = plan.layout[f].pivots;
  if (position < first + pivots) return position - first;
  const Index *begin = plan.rows_below(f), *end = begin + plan.layout[f].below();
  const Index* at = std::lower_bound(begin, end, position);
  return at != end && *at == position ? pivots + static_cast<Index>(at - begin) : -1;
}

/// The front of each pivot, by position.
inline std::vector<Index> fronts_of_positions(const plan::Plan& plan) {
  std::vector<Index> front(static_cast<std::size_t>(plan.tree.n));
  for (Index f = 0; f < plan.fronts(); ++f)
    std::fill(front.begin() + plan.tree.first[f], front.begin() + plan.tree.first[f + 1], f);
  return front;
}

/// The fronts that may have some of the entries, and those above them: no others have to be made.
template <class T>
std::vector<char> fronts_to_make(const plan::Plan& plan, const InverseEntries<T>& entries, base::ThreadPool& pool) {
  constexpr std::int64_t kGrain = 1 << 14;  // entries a range
  const std::vector<Index> front_of = fronts_of_positions(plan);
  std::vector<char> needed(static_cast<std::size_t>(plan.fronts()), 0);
  pool.for_each_range(static_cast<std::int64_t>(entries.row.size()), kGrain, [&](std::int64_t begin, std::int64_t end) {
    for (auto e = static_cast<std::size_t>(begin); e < static_cast<std::size_t>(end); ++e) {
      const auto first = static_cast<std::size_t>(std::min(entries.row[e], entries.col[e]));
      const std::atomic_ref<char> mark(needed[static_cast<std::size_t>(front_of[first])]);
      if (mark.load(std::memory_order_relaxed) == 0) mark.store(1, std::memory_order_relaxed);
    }
  });
  for (Index f = 0; f < plan.fronts(); ++f)
    if (const Index parent = plan.tree.parent[static_cast<std::size_t>(f)]; parent >= 0)
      needed[static_cast<std::size_t>(parent)] |= needed[static_cast<std::size_t>(f)];
  return needed;
}

/// Fills entries.known, and finds the others.
template <class T>
InversePlaces find_inverse_places(const plan::Plan& plan, const InverseEntries<T>& entries, base::ThreadPool& pool,
                                  base::MemoryBudget* budget) {
  constexpr std::int64_t kGrain = 1 << 14, kMostCounts = 1 << 22;
  const auto fronts = static_cast<std::int64_t>(plan.fronts());
  const std::vector<Index> front_of = fronts_of_positions(plan);
  const auto count = static_cast<std::int64_t>(entries.row.size());
  // By the front that has them, in their order: parts of the list are counted, then put, whatever the threads.
  const std::int64_t parts = std::clamp<std::int64_t>(
      std::min<std::int64_t>(count / kGrain, kMostCounts / std::max<std::int64_t>(1, fronts)), 1, 64);
  base::Buffer<Index> front(count, budget), place(count, budget);
  std::vector<Offset> next(static_cast<std::size_t>(parts * fronts), 0);
  const auto over_parts = [&](auto&& use) {
    pool.for_each_range(parts, 1, [&](std::int64_t part, std::int64_t) {
      Offset* counts = next.data() + part * fronts;
      for (std::int64_t e = count * part / parts; e < count * (part + 1) / parts; ++e) use(e, counts);
    });
  };
  over_parts([&](std::int64_t e, Offset* counts) {
    const auto at = static_cast<std::size_t>(e);
    const Index first = std::min(entries.row[at], entries.col[at]), last = std::max(entries.row[at], entries.col[at]);
    const Index f = front_of[static_cast<std::size_t>(first)];
    place[e] = row_in_front(plan, f, last);
    entries.known[at] = place[e] >= 0 ? 1 : 0;
    front[e] = place[e] >= 0 ? f : -1;
    if (place[e] >= 0) ++counts[f];
  });
  InversePlaces wanted;
  wanted.ptr.assign(static_cast<std::size_t>(fronts) + 1, 0);
  Offset before = 0;
  for (std::int64_t f = 0; f < fronts; ++f) {
    wanted.ptr[static_cast<std::size_t>(f)] = before;
    for (std::int64_t part = 0; part < parts; ++part)
      before += std::exchange(next[static_cast<std::size_t>(part * fronts + f)], before);
  }
  wanted.ptr.back() = before;
  wanted.places = base::Buffer<InversePlaces::Place>(before, budget);
  over_parts([&](std::int64_t e, Offset* to) {
    if (place[e] < 0) return;
    const auto at = static_cast<std::size_t>(e);
    const Index pivot = std::min(entries.row[at], entries.col[at]) - plan.tree.first[front[e]];
    const bool by_row = entries.row[at] <= entries.col[at];
    wanted.places[to[front[e]]++] = {by_row ? pivot : place[e], by_row ? place[e] : pivot, e};
  });
  return wanted;
}

}  // namespace espalier::device
