// Work of the first rank for all: what the others get, and how it ends.
#include "ranks/first_rank.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "on_threads.hpp"
#include "ranks/packing.hpp"

namespace espalier::ranks {
namespace first_rank_test {

// How `body` ends as one call of all ranks.
Status called(const Ranks& ranks, const std::function<void(Communicator&, base::ThreadPool&)>& body,
              base::Interruption* interruption = nullptr) {
  Communicator& link = *ranks.link();
  base::ThreadPool pool(1, interruption);
  link.begin_call();
  Status own;
  try {
    body(link, pool);
  } catch (const Error& e) {
    own = e.status();
  }
  return link.end_call(own);
}

// Longer than the others are patient: a rank that works is not one that is lost.
TEST(FirstRank, GivesSignsOfLifeWhileItWorks) {
  on_threads(
      3, {},
      [&](const Ranks& ranks) {
        std::vector<int> told;
        const Status end = called(ranks, [&](Communicator& link, base::ThreadPool& pool) {
          Packer mine;
          by_first_rank(link, pool, [&] {
            std::this_thread::sleep_for(std::chrono::milliseconds(1500));
            mine.pack(std::vector<int>{3, 1, 4});
          });
          const std::vector<std::byte> bytes = from_first_rank(link, mine.bytes());
          Unpacker(bytes).get(told);
        });
        EXPECT_TRUE(end.ok()) << end.message;
        EXPECT_EQ(told, (std::vector<int>{3, 1, 4}));
      },
      1);
}

TEST(FirstRank, FailsForAll) {
  on_threads(3, {}, [&](const Ranks& ranks) {
    const Status end = called(ranks, [&](Communicator& link, base::ThreadPool& pool) {
      by_first_rank(link, pool, [] { throw Error(StatusCode::singular, "a row is empty", 7); });
    });
    EXPECT_EQ(end.code, StatusCode::singular);
    EXPECT_EQ(end.row, 7);
    EXPECT_NE(end.message.find("rank 0"), std::string::npos) << end.message;
    EXPECT_NE(end.message.find("a row is empty"), std::string::npos) << end.message;
    EXPECT_TRUE(
        called(ranks, [](Communicator& link, base::ThreadPool& pool) { by_first_rank(link, pool, [] {}); }).ok());
  });
}

// The thread that calls asks whether to go on; the one that works hears of it.
TEST(FirstRank, IsInterrupted) {
  on_threads(2, {}, [&](const Ranks& ranks) {
    int asked = 0;
    const std::thread::id caller = std::this_thread::get_id();
    base::Interruption interruption(
        [&] {
          EXPECT_EQ(std::this_thread::get_id(), caller);
          return ++asked > 3;
        },
        {});
    const base::Interruption::Call call(interruption);
    const Status end = called(
        ranks,
        [&](Communicator& link, base::ThreadPool& pool) {
          by_first_rank(link, pool, [&] {
            for (;;) pool.check();
          });
        },
        &interruption);
    EXPECT_EQ(end.code, StatusCode::cancelled) << end.message;
  });
}

TEST(Packing, GivesBackWhatWasPut) {
  Packer packer;
  packer.pack(3.5);
  packer.pack(std::string("two words"));
  packer.pack(std::vector<Index>{});
  packer.pack(std::vector<Offset>{1, -2});
  double number = 0;
  std::string text;
  std::vector<Index> none{1};
  std::vector<Offset> two;
  Unpacker from(packer.bytes());
  from.get(number);
  from.get(text);
  from.get(none);
  from.get(two);
  EXPECT_EQ(number, 3.5);
  EXPECT_EQ(text, "two words");
  EXPECT_TRUE(none.empty());
  EXPECT_EQ(two, (std::vector<Offset>{1, -2}));
  EXPECT_THROW(from.get(number), Error);
  Unpacker half(packer.bytes().first(packer.bytes().size() - 1));
  half.get(number);
  half.get(text);
  half.get(none);
  EXPECT_THROW(half.get(two), Error);
}

}  // namespace first_rank_test
}  // namespace espalier::ranks
