// The team of threads: every index once, the first exception out, usable afterwards.
#include "base/thread_pool.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <set>
#include <stdexcept>
#include <string>

namespace espalier::base {
namespace {

TEST(ThreadPool, RunsEveryWorkerOnce) {
  for (const int threads : {-1, 0, 1, 2, 5}) {
    ThreadPool pool(threads);
    EXPECT_EQ(pool.size(), std::max(1, threads));
    for (int round = 0; round < 20; ++round) {
      std::vector<std::atomic<int>> calls(static_cast<std::size_t>(pool.size()));
      pool.run([&](int worker) { ++calls[static_cast<std::size_t>(worker)]; });
      for (const auto& c : calls) EXPECT_EQ(c, 1);
    }
  }
}

TEST(ThreadPool, PiecesCoverTheRangeAndDoNotDependOnThreads) {
  for (const std::int64_t n : {0, 1, 7, 100, 1001})
    for (const std::int64_t grain : {-3, 0, 1, 10, 1000, 5000}) {
      std::set<std::pair<std::int64_t, std::int64_t>> first;
      for (const int threads : {1, 2, 4}) {
        ThreadPool pool(threads);
        std::vector<std::atomic<int>> hits(static_cast<std::size_t>(n));
        std::mutex mutex;
        std::set<std::pair<std::int64_t, std::int64_t>> pieces;
        pool.for_each_range(n, grain, [&](std::int64_t b, std::int64_t e) {
          for (std::int64_t k = b; k < e; ++k) ++hits[static_cast<std::size_t>(k)];
          const std::lock_guard lock(mutex);
          pieces.emplace(b, e);
        });
        for (const auto& h : hits) EXPECT_EQ(h, 1);
        if (threads == 1) first = pieces;
        EXPECT_EQ(pieces, first) << n << " by " << grain << " on " << threads;
        std::atomic<std::int64_t> sum{0};
        pool.for_each(n, [&](std::int64_t i) { sum += i; });
        EXPECT_EQ(sum, n * (n - 1) / 2);
      }
    }
}

// Workers that sleep are not waited for: all work is done all the same, by whoever comes, each worker once a call.
TEST(ThreadPool, WhoComesTooLateIsNotWaitedFor) {
  ThreadPool pool(4);
  std::int64_t helped = 0;
  for (int call = 0; call < 2000; ++call) {
    std::atomic<int> next{0}, inside{0};
    std::vector<int> done(50, 0), times(4, 0);
    pool.share([&](int worker) {
      ++inside;
      ++times[static_cast<std::size_t>(worker)];
      for (int k = next++; k < 50; k = next++) ++done[static_cast<std::size_t>(k)];
      --inside;
    });
    ASSERT_EQ(inside, 0);
    ASSERT_EQ(done, std::vector<int>(50, 1));
    ASSERT_EQ(times[0], 1);
    for (const int t : times) {
      ASSERT_LE(t, 1);
      helped += t;
    }
    std::atomic<int> all{0};  // the other sort of call in between
    if (call % 3 == 0) {
      pool.run([&](int) { ++all; });
      ASSERT_EQ(all, 4);
    }
  }
  EXPECT_GE(helped, 2000);
}

TEST(ThreadPool, RethrowsTheLowestWorkersExceptionAndGoesOn) {
  ThreadPool pool(4);
  for (int round = 0; round < 50; ++round) {
    std::string caught;
    try {
      pool.run([&](int worker) {
        if (worker != 1) throw std::runtime_error(std::to_string(worker));
      });
    } catch (const std::runtime_error& e) {
      caught = e.what();
    }
    EXPECT_EQ(caught, "0");
    EXPECT_THROW(pool.run([](int worker) {
      if (worker == 3) throw std::logic_error("three");
    }),
                 std::logic_error);
    EXPECT_THROW(pool.for_each(100,
                               [](std::int64_t i) {
                                 if (i == 57) throw std::runtime_error("piece");
                               }),
                 std::runtime_error);
    std::atomic<int> calls{0};
    pool.run([&](int) { ++calls; });
    EXPECT_EQ(calls, 4);
  }
}

TEST(ThreadPool, OwnPoolsMayBeNested) {
  ThreadPool outer(2);
  std::atomic<std::int64_t> sum{0};
  outer.for_each(8, [&](std::int64_t i) {
    ThreadPool inner(2);
    inner.for_each_range(100, 7, [&](std::int64_t b, std::int64_t e) { sum += (e - b) * (i + 1); });
  });
  EXPECT_EQ(sum, 100 * 36);
}

// Number of leaves of a binary tree of that depth.
void grow(Recursion& r, int depth, std::atomic<int>& leaves) {
  if (depth == 0) {
    ++leaves;
    return;
  }
  for (int k = 0; k < 2; ++k) r.spawn([depth, &leaves](Recursion& next) { grow(next, depth - 1, leaves); });
}

TEST(Recursion, RunsEveryTaskAndRethrows) {
  for (const int threads : {1, 2, 4}) {
    ThreadPool pool(threads);
    for (int round = 0; round < 20; ++round) {
      std::atomic<int> leaves{0};
      Recursion::run(pool, [&](Recursion& r) { grow(r, 8, leaves); });
      EXPECT_EQ(leaves, 256);
      EXPECT_THROW(Recursion::run(pool,
                                  [&](Recursion& r) {
                                    grow(r, 5, leaves);
                                    r.spawn([](Recursion&) { throw std::runtime_error("task"); });
                                  }),
                   std::runtime_error);
      EXPECT_THROW(Recursion::run(pool, [](Recursion&) { throw std::logic_error("root"); }), std::logic_error);
    }
  }
}

TEST(Recursion, LoopsCoverTheirRangeBesideTasks) {
  constexpr std::int64_t kSize = 5000, kTasks = 6;
  for (const int threads : {1, 2, 4}) {
    ThreadPool pool(threads);
    for (int round = 0; round < 20; ++round) {
      std::vector<std::atomic<int>> visits(static_cast<std::size_t>(kSize * kTasks));
      Recursion::run(pool, [&](Recursion& r) {
        for (std::int64_t t = 0; t < kTasks; ++t)
          r.spawn([&visits, t](Recursion& mine) {
            mine.for_each_range(kSize, 7, [&](std::int64_t begin, std::int64_t end) {
              EXPECT_TRUE(end - begin == 7 || end == kSize);
              for (std::int64_t i = begin; i < end; ++i) ++visits[static_cast<std::size_t>(t * kSize + i)];
            });
            for (std::int64_t i = 0; i < kSize; ++i) EXPECT_EQ(visits[static_cast<std::size_t>(t * kSize + i)], 1);
          });
      });
      EXPECT_THROW(Recursion::run(pool,
                                  [](Recursion& r) {
                                    r.for_each_range(100, 1, [](std::int64_t i, std::int64_t) {
                                      if (i == 57) throw std::runtime_error("piece");
                                    });
                                  }),
                   std::runtime_error);
    }
  }
}

TEST(AvailableCores, AtLeastOne) { EXPECT_GE(available_cores(), 1); }

}  // namespace
}  // namespace espalier::base
