// Ranks of different machines exchange what their kernels make (tile_exchange.hpp), emulated: at the end everybody has
// everybody's numbers. Messages come late and in random order, few at a time, or not at all.
#include "device/cuda/tables/tile_exchange.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "emulated_machines.hpp"
#include "watched_table.hpp"

namespace espalier {
namespace tile_exchange_test {

using device::cuda::CopyThread;
using device::cuda::SentTile;
using device::cuda::TileMessages;
using device::cuda::Way;
using device::cuda::Work;
using emulated::on_ranks;
using emulated::Rank;
using emulated::SlowQueues;
using emulated::System;
using emulated::Table;
using emulated::WatchedTable;

// Sends of row blocks of tiles end late. most(): how many messages were open to all of `receivers` ranks, and had been
// so for some time, when another one began.
class LateSends final : public WatchedTable {
 public:
  LateSends(const Table& inner, const TileMessages& messages, std::size_t receivers)
      : WatchedTable(inner), messages_(messages), receivers_(receivers) {}
  [[nodiscard]] std::size_t most() const { return most_; }

 private:
  struct Open {
    void* request = nullptr;        // of the inner table
    const void* message = nullptr;  // null: none of those
    int looks = 0;                  // for which it stays open
  };
  static constexpr int kLooks = 1500, kCopy = 500;  // what was begun before the copy for the next message

  int send(const void* data, std::size_t bytes, std::int32_t to, void** request) override {
    auto open = std::make_unique<Open>();
    const int error = inner_.send(inner_.context, data, bytes, to, &open->request);
    ranks::Header header;
    std::memcpy(&header, data, sizeof header);
    if (error == 0 && header.kind == 1 &&
        messages_.tiles(inner_.rank).at(static_cast<std::size_t>(header.number)).task.work == Work::block) {
      open->looks = kLooks;
      open->message = data;
      std::map<const void*, std::size_t> old;  // receivers by message
      for (const auto& other : opened_)
        if (other->message != nullptr && other->looks < kLooks - kCopy) ++old[other->message];
      const auto whole = std::count_if(old.begin(), old.end(), [&](const auto& m) { return m.second == receivers_; });
      most_ = std::max(most_, static_cast<std::size_t>(whole));
    }
    *request = open.get();
    opened_.push_back(std::move(open));
    return error;
  }
  int test(void** request, std::int32_t* done) override {
    const auto found =
        std::find_if(opened_.begin(), opened_.end(), [&](const auto& open) { return open.get() == *request; });
    if (found == opened_.end()) return inner_.test(inner_.context, request, done);  // a receipt
    *done = 0;
    if (--(*found)->looks > 0) return 0;
    const int error = inner_.test(inner_.context, &(*found)->request, done);
    if (*done == 0) return error;
    opened_.erase(found);
    *request = nullptr;
    return error;
  }

  const TileMessages& messages_;
  std::size_t receivers_, most_ = 0;
  std::vector<std::unique_ptr<Open>> opened_;
};

// Counts, by other machine, how often a message crosses to it. Of all ranks, one after another.
class Crossings {
 public:
  struct Message {
    int from;
    std::uint32_t operation;
    std::int32_t kind;
    std::int64_t number;
    int machine;
    auto operator<=>(const Message&) const = default;
  };
  struct Landed {
    int times = 0, count = 0, on = -1;  // what it has; and the rank
  };

  explicit Crossings(const System& system) : system_(system) {}
  Table around(const Table& inner) {
    const std::lock_guard lock(mutex_);
    return tables_.emplace_back(inner, *this).table();
  }
  [[nodiscard]] const std::map<Message, Landed>& messages() const { return messages_; }
  [[nodiscard]] int within() const { return within_; }

 private:
  class Counted final : public WatchedTable {
   public:
    Counted(const Table& inner, Crossings& all) : WatchedTable(inner), all_(all) {}

   private:
    int send(const void* data, std::size_t bytes, std::int32_t to, void** request) override {
      ranks::Header header;
      std::memcpy(&header, data, sizeof header);
      if (header.kind >= 1 && header.kind <= 3 && header.call == kCall) all_.count(header, inner_.rank, to);
      return WatchedTable::send(data, bytes, to, request);
    }
    static constexpr std::uint32_t kCall = 2;  // the first is that of the link's beginning
    Crossings& all_;
  };

  void count(const ranks::Header& header, int from, int to) {
    const std::lock_guard lock(mutex_);
    if (system_.are_near(from, to)) ++within_;
    Landed& landed = messages_[{from, header.operation, header.kind, header.number, to / system_.per_machine}];
    ++landed.times;
    landed.count = header.row;
    landed.on = to;
  }

  const System& system_;
  std::mutex mutex_;
  std::deque<Counted> tables_;
  std::map<Message, Landed> messages_;
  int within_ = 0;
};

void expect_exchange(const System& system, const ranks::Faults& faults, std::size_t slots) {
  const auto ends = on_ranks(system, faults, 60, slots, [](Rank& rank) {
    rank.factorize(1);
    rank.share(1);
    rank.solve(1, 1);
    rank.solve(2, emulated::kMostPass);
    rank.share(2);
    rank.factorize(2);
  });
  for (const Status& end : ends) EXPECT_TRUE(end.ok()) << end.message;
}

TEST(TileExchange, BringsEverythingToEverybody) {
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::llt, 2), {}, 64);
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::ldlt, 3), {}, 64);
  expect_exchange(System({"gyroscopic", "7", "6", "6"}, Kind::lu, 4), {}, 64);
}

// Machines of several ranks, of the same number or not.
TEST(TileExchange, SeveralRanksOfAMachine) {
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::llt, 4, 2), {}, 64);
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::ldlt, 4, 3), {}, 64);
  expect_exchange(System({"gyroscopic", "7", "6", "6"}, Kind::lu, 6, 2), {}, 64);
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::llt, 6, 3), {}, 64);
}

TEST(TileExchange, SeveralRanksOfAMachineWithLateMessagesAndLittleRoom) {
  ranks::Faults faults;
  faults.most_delay = 0.0005;
  faults.reorder = true;
  faults.credits = 2;
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::ldlt, 5, 2), faults, 64);
  expect_exchange(System({"gyroscopic", "7", "6", "6"}, Kind::lu, 4, 2), faults, 4);
}

// However many ranks of a machine need a tile, a part of a vector or values, the network has them once.
TEST(TileExchange, AMessageCrossesToAMachineOnce) {
  const System system({"elasticity", "8", "7", "7"}, Kind::llt, 6, 3);
  const TileMessages messages(system.plan, system.kind, system.tables);
  Crossings crossings(system);
  const auto ends = on_ranks(
      system, {}, 60, 64,
      [](Rank& rank) {
        rank.factorize(1);
        rank.solve(1, 1);
        rank.share(1);
      },
      [&](const Table& table) { return crossings.around(table); });
  for (const Status& end : ends) EXPECT_TRUE(end.ok()) << end.message;
  EXPECT_EQ(crossings.within(), 0);
  std::int64_t expected[4] = {}, tiles = 0, found[4] = {}, landed[6][4] = {};
  for (int r = 0; r < system.ranks; ++r) {
    const unsigned others = r < 3 ? 0b111000 : 0b000111;
    for (const SentTile& tile : messages.tiles(r))
      if ((tile.receivers & others) != 0) {
        ++expected[1];
        tiles += std::popcount(tile.receivers & others);
      }
    for (const auto& u : messages.updates(r)) expected[2] += (u.receivers & others) != 0 ? 1 : 0;
    expected[3] += r == 1 ? 0 : 6;  // share(): five slots and a rest
  }
  for (const auto& [message, landing] : crossings.messages()) {
    EXPECT_EQ(landing.times, 1) << "from " << message.from << ", kind " << message.kind << ", " << message.number;
    found[message.kind] += landing.count;
    ++landed[landing.on][message.kind];
  }
  EXPECT_GT(tiles, expected[1]);  // so some are for several ranks of a machine
  for (const int kind : {1, 2, 3}) EXPECT_EQ(found[kind], expected[kind]) << kind;
  for (const auto& of_rank : landed)
    for (const int kind : {1, 3}) EXPECT_GT(of_rank[kind], 0);  // all ranks take their share
}

TEST(TileExchange, LateMessagesInAnyOrderAndFewAtATime) {
  ranks::Faults faults;
  faults.most_delay = 0.0005;
  faults.reorder = true;
  faults.credits = 2;
  expect_exchange(System({"elasticity", "7", "6", "6"}, Kind::llt, 3), faults, 64);
}

// How many messages leave at a time does not depend on how many ranks get each.
TEST(TileExchange, AMessageToManyRanksIsOneMessage) {
  constexpr int kAttempts = 5;  // on a busy machine the ranks may take turns, and no two messages are open at a time
  const System system({"elasticity", "8", "7", "7"}, Kind::llt, 5);
  const TileMessages messages(system.plan, system.kind, system.tables);
  std::size_t most = 0;
  for (int k = 0; k < kAttempts && most < 2; ++k) {
    std::mutex mutex;
    std::deque<LateSends> late;
    const auto ends = on_ranks(
        system, {}, 60, 64, [](Rank& rank) { rank.factorize(1); },
        [&](const Table& table) {
          const std::lock_guard lock(mutex);
          return late.emplace_back(table, messages, 4).table();
        });
    for (const LateSends& of_rank : late) most = std::max(most, of_rank.most());
    for (const Status& end : ends) ASSERT_TRUE(end.ok()) << end.message;
  }
  EXPECT_GE(most, 2U);  // were it receivers, one is the most
}

TEST(TileExchange, AlmostNoRoomForMessages) {
  expect_exchange(System({"gyroscopic", "7", "6", "6"}, Kind::lu, 3), {}, 4);
}

TEST(TileExchange, ARankThatDiesIsNamedByAllOthers) {
  const System system({"elasticity", "7", "6", "6"}, Kind::llt, 3);
  ranks::Faults faults;
  faults.dead_rank = 1;
  faults.dies_at = 12;
  const auto ends = on_ranks(system, faults, 0.3, 64, [](Rank& rank) {
    for (int run = 1; run < 5; ++run) rank.factorize(run);
  });
  for (const int survivor : {0, 2}) {
    EXPECT_EQ(ends[static_cast<std::size_t>(survivor)].code, StatusCode::device_error);
    EXPECT_NE(ends[static_cast<std::size_t>(survivor)].message.find("rank 1 on host"), std::string::npos)
        << ends[static_cast<std::size_t>(survivor)].message;
  }
}

// Where what comes for others lands, too.
TEST(TileExchange, ARankThatDiesIsNamedOnBothMachines) {
  const System system({"elasticity", "7", "6", "6"}, Kind::llt, 4, 2);
  for (const int dead : {0, 3})
    for (const std::int64_t at : {30, 37, 44, 60}) {
      ranks::Faults faults;
      faults.dead_rank = dead;
      faults.dies_at = at;
      faults.deaths_are_told = at != 37;  // silence takes its time
      const auto ends = on_ranks(system, faults, 1, 64, [](Rank& rank) {
        for (int run = 1; run < 40; ++run) {
          rank.factorize(run);
          rank.solve(run, 1);
        }
      });
      for (int r = 0; r < system.ranks; ++r) {
        if (r == dead) continue;
        const Status& end = ends[static_cast<std::size_t>(r)];
        EXPECT_EQ(end.code, StatusCode::device_error) << "rank " << r << ", dead " << dead << " at " << at;
        EXPECT_NE(end.message.find("rank " + std::to_string(dead) + " on host"), std::string::npos) << end.message;
      }
    }
}

// A rank dies while values go around: all others say so, and their copies have ended.
TEST(TileExchange, ARankThatDiesBetweenValues) {
  const System system({"elasticity", "7", "6", "6"}, Kind::llt, 3);
  ranks::Faults faults;
  faults.dead_rank = 0;
  faults.dies_at = 20;
  const auto ends = on_ranks(system, faults, 0.3, 64, [](Rank& rank) {
    for (int run = 1; run < 20; ++run) rank.share(run);
  });
  for (const int survivor : {1, 2}) {
    EXPECT_EQ(ends[static_cast<std::size_t>(survivor)].code, StatusCode::device_error);
    EXPECT_NE(ends[static_cast<std::size_t>(survivor)].message.find("rank 0 on host"), std::string::npos)
        << ends[static_cast<std::size_t>(survivor)].message;
  }
}

// One rank is in another operation than the others expect: an error on all, no number in a wrong place.
TEST(TileExchange, ARankThatMakesOtherCallsIsNamed) {
  const System system({"elasticity", "7", "6", "6"}, Kind::llt, 3);
  const auto ends = on_ranks(system, {}, 60, 64, [](Rank& rank) {
    if (rank.number() == 2) (void)rank.link().all_numbers(1);  // what factorize() begins with
    rank.number() == 2 ? rank.share(1) : rank.factorize(1);
  });
  for (const Status& end : ends) {
    EXPECT_EQ(end.code, StatusCode::device_error);
    EXPECT_NE(end.message.find("makes other calls"), std::string::npos) << end.message;
  }
}

TEST(TileExchange, KernelsWaitLongerThanTheLink) {
  EXPECT_GT(device::cuda::patience_of_kernels(0.5), 0.5);
  EXPECT_GT(device::cuda::patience_of_kernels(300), 300);
  EXPECT_LT(device::cuda::patience_of_kernels(1e300), 9e9);  // nanoseconds fit into 64 bits
}

// Commands in their order, marks by way, and a failure that the next look tells.
TEST(CopyThread, CopiesInOrderAndTellsFailures) {
  std::mutex devices;
  SlowQueues slow(3, devices);
  bool begun = false;
  CopyThread copies(slow, [&] { begun = true; });
  std::vector<std::byte> from(64), host(64), to(64), other(64);
  for (int run = 1; run < 200; ++run) {
    std::fill(from.begin(), from.end(), static_cast<std::byte>(run));
    copies.copy(Way::to_host, {host.data(), from.data(), 64, 64, 1});
    const std::uint64_t out = copies.mark(Way::to_host);
    while (!copies.is_done(out)) std::this_thread::yield();
    copies.copy(Way::to_device, {host.data(), to.data(), 16, 16, 4});
    const std::uint64_t in = copies.mark(Way::to_device);
    EXPECT_NE(in, out);
    while (!copies.is_done(in)) std::this_thread::yield();
    ASSERT_EQ(to, from);
    copies.pass_on({to.data(), other.data(), 16, 16, 4});
    const std::uint64_t passed = copies.mark(Way::to_device);
    while (!copies.is_done(passed)) std::this_thread::yield();
    ASSERT_EQ(other, from);
    if (run % 50 != 0) continue;
    copies.copy(Way::to_host, {nullptr, nullptr, 0, 0, 0});
    const std::uint64_t failed = copies.mark(Way::to_host);
    EXPECT_THROW(while (!copies.is_done(failed)) std::this_thread::yield(), Error);
    copies.finish();
  }
  EXPECT_TRUE(begun);
}

TEST(TileExchange, KernelsThatGiveUpEndTheCallOnAllRanks) {
  const System system({"elasticity", "7", "6", "6"}, Kind::llt, 3);
  const auto ends = on_ranks(system, {}, 60, 64, [](Rank& rank) {
    if (rank.number() == 2) rank.abort_after(3);
    rank.factorize(1);
  });
  for (const Status& end : ends) {
    EXPECT_EQ(end.code, StatusCode::device_error);
    EXPECT_NE(end.message.find("rank 2 on host"), std::string::npos) << end.message;
    EXPECT_NE(end.message.find("gave up waiting"), std::string::npos) << end.message;
  }
}

}  // namespace tile_exchange_test
}  // namespace espalier
