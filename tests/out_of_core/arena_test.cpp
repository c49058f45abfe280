// Places and hazards of out-of-core plans. Truth: a byte map, and a record of every operation on every place.
#include "out_of_core/arena.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

namespace espalier::out_of_core {
namespace {

TEST(Arena, PlacesDoNotOverlapAndNothingIsLost) {
  constexpr Offset kUnits = 64;
  Arena arena(kUnits * Arena::kAlignment + 17);
  EXPECT_EQ(arena.size(), kUnits * Arena::kAlignment);
  std::vector<int> owner(kUnits, -1);
  struct Place {
    Offset at, bytes;
  };
  std::vector<Place> held;
  std::mt19937 random(5);
  Offset highest = 0;
  for (int step = 0; step < 20000; ++step) {
    if (!held.empty() && random() % 2 == 0) {
      const std::size_t k = random() % held.size();
      const Offset first = held[k].at / Arena::kAlignment;
      std::fill_n(owner.begin() + first, Arena::round(held[k].bytes) / Arena::kAlignment, -1);
      arena.give_back(held[k].at, held[k].bytes);
      held.erase(held.begin() + static_cast<std::ptrdiff_t>(k));
      continue;
    }
    const Offset bytes = 1 + static_cast<Offset>(random() % (12 * Arena::kAlignment));
    const Offset units = Arena::round(bytes) / Arena::kAlignment;
    const auto way = random() % 3;
    const Offset at = way == 0   ? arena.take_passing(bytes)
                      : way == 1 ? arena.take_lasting(bytes)
                                 : arena.take_lowest(bytes);
    Offset longest = 0, run = 0;
    for (const int o : owner) longest = std::max(longest, run = o < 0 ? run + 1 : 0);
    if (at < 0) {
      EXPECT_LT(longest, units) << "there was room";
      continue;
    }
    const Offset first = at / Arena::kAlignment;
    ASSERT_LE(first + units, kUnits);
    for (Offset u = first; u < first + units; ++u) {
      ASSERT_LT(owner[static_cast<std::size_t>(u)], 0) << "taken twice";
      owner[static_cast<std::size_t>(u)] = step;
    }
    held.push_back({at, bytes});
    highest = std::max(highest, at + Arena::round(bytes));
  }
  EXPECT_EQ(arena.peak(), highest);
  for (const Place& p : held) arena.give_back(p.at, p.bytes);
  EXPECT_EQ(arena.take_lowest(arena.size()), 0);
}

TEST(Arena, WhatPassesGoesRound) {
  Arena arena(8 * Arena::kAlignment);
  std::vector<Offset> places;
  for (int k = 0; k < 8; ++k) {
    places.push_back(arena.take_passing(1));
    arena.give_back(places.back(), 1);
  }
  std::sort(places.begin(), places.end());
  EXPECT_EQ(std::unique(places.begin(), places.end()), places.end()) << "a place was taken again before the others";
}

TEST(Touches, WaitsCoverEveryHazard) {
  constexpr int kPlaces = 20;
  struct Record {
    int queue;
    std::int64_t number;
    bool write;
  };
  std::array<std::vector<Record>, kPlaces> records;
  constexpr int kQueues = 4;
  Touches touches(kQueues);
  std::array<std::int64_t, kQueues> count{};
  std::mt19937 random(9);
  std::int64_t idle = 0;
  for (int step = 0; step < 5000; ++step) {
    const int queue = static_cast<int>(random() % kQueues), first = static_cast<int>(random() % kPlaces);
    const int end = std::min<int>(kPlaces, first + 1 + static_cast<int>(random() % 5));
    const bool write = random() % 2 == 0;
    const std::int64_t number = ++count[static_cast<std::size_t>(queue)];
    std::array<std::int64_t, kQueues> waits{};
    touches.touch(first, end - first, queue, number, write, waits);
    EXPECT_EQ(waits[static_cast<std::size_t>(queue)], 0) << "a queue is in order by itself";
    for (int p = first; p < end; ++p) {
      for (const Record& r : records[static_cast<std::size_t>(p)])
        if (r.queue != queue && (r.write || write)) {
          ASSERT_GE(waits[static_cast<std::size_t>(r.queue)], r.number);
        }
      records[static_cast<std::size_t>(p)].push_back({queue, number, write});
    }
    for (std::size_t q = 0; q < waits.size(); ++q) {
      ASSERT_LE(waits[q], count[q]) << "waits for what comes later";
      idle += waits[q] < count[q] ? 1 : 0;
    }
  }
  EXPECT_GT(idle, 0) << "everything waits for everything";
}

}  // namespace
}  // namespace espalier::out_of_core
