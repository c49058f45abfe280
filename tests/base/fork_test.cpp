// Threads after fork(), and threads that the system refuses. Truth: sums of whole numbers, made in a child process that
// must end in time.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <barrier>
#include <memory>
#include <new>
#include <thread>

#include "base/thread_pool.hpp"
#include "process.hpp"

namespace espalier::base {
namespace {

bool adds_up(ThreadPool& pool) {
  constexpr std::int64_t kNumbers = 100000;
  std::atomic<std::int64_t> sum{0};
  for (int round = 0; round < 20; ++round)
    pool.for_each_range(kNumbers, 100, [&](std::int64_t b, std::int64_t e) {
      for (std::int64_t k = b; k < e; ++k) sum += k;
    });
  return sum == 20 * (kNumbers * (kNumbers - 1) / 2);
}

TEST(Fork, ThePoolOfTheParentWorksInTheChild) {
  ThreadPool pool(3);
  ASSERT_TRUE(adds_up(pool));
  EXPECT_EQ(test::in_child([&] { return adds_up(pool) && pool.size() == 3; }), 0);
  // The child of the child, too; and the parent's own threads are still there.
  EXPECT_EQ(test::in_child([&] { return adds_up(pool) && test::in_child([&] { return adds_up(pool); }) == 0; }), 0);
  EXPECT_TRUE(adds_up(pool));
}

TEST(Fork, WhileThePoolIsAtWork) {
  ThreadPool pool(3);
  std::atomic<bool> stop{false};
  std::thread busy([&] {
    while (!stop) EXPECT_TRUE(adds_up(pool));
  });
  for (int round = 0; round < 20; ++round) EXPECT_EQ(test::in_child([&] { return adds_up(pool); }), 0) << round;
  stop = true;
  busy.join();
}

TEST(Fork, APoolThatIsNotUsedEndsInTheChild) {
  auto pool = std::make_unique<ThreadPool>(3);
  ASSERT_TRUE(adds_up(*pool));
  EXPECT_EQ(test::in_child([&] {
              pool.reset();
              return true;
            }),
            0);
}

// The stacks of 400 threads do not fit into what is left of the address space.
TEST(Threads, ThatTheSystemRefusesAreDoneWithout) {
#if defined(ESPALIER_SANITIZED)
  GTEST_SKIP() << "the sanitizers need the address space";
#endif
  EXPECT_EQ(test::in_child([] {
              test::limit_address_space(std::uint64_t{100} << 20);
              ThreadPool pool(400);
              return pool.size() >= 1 && pool.size() < 400 && adds_up(pool);
            }),
            0);
}

// Where the system refuses one, half of the others are given back. All that are left fail at the same time, with no
// memory in the process: C++ has some tens of kilobytes for the exceptions of such a moment, and ends it beyond.
TEST(Threads, ThatRunCanAllFailAtOnce) {
#if defined(ESPALIER_SANITIZED)
  GTEST_SKIP() << "the sanitizers need the address space";
#endif
  const auto fail_together = [] {
    test::limit_address_space(std::uint64_t{6} << 30);
    ThreadPool pool(4096);
    std::barrier all(pool.size());
    std::atomic<int> failed{0};
    pool.run([&](int) {
      // On the stack: with an arena for each of many threads the address space may be full here already, and who throws
      // before the barrier is waited for without end.
      std::array<std::unique_ptr<char[]>, 10000> kept;
      all.arrive_and_wait();
      std::size_t many = 0;
      for (std::size_t size = std::size_t{1} << 26; size >= 32 && many < kept.size();) {
        kept[many].reset(new (std::nothrow) char[size]);
        if (kept[many] == nullptr)
          size /= 2;
        else
          ++many;
      }
      all.arrive_and_wait();
      try {
        throw std::bad_alloc();
      } catch (const std::bad_alloc&) {
        ++failed;
        all.arrive_and_wait();
      }
    });
    return pool.size() > 1 && pool.size() < 4096 && failed == pool.size() && adds_up(pool);
  };
  EXPECT_EQ(test::in_child(fail_together), 0);
}

}  // namespace
}  // namespace espalier::base
