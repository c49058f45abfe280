// How a caller stops a call. Truth: which thread was asked, and which pieces of work were done.
#include "base/interruption.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "base/thread_pool.hpp"
#include "espalier/types.hpp"

namespace espalier::base {
namespace {

using namespace std::chrono_literals;

StatusCode code_of(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& e) {
    return e.status().code;
  }
  return StatusCode::ok;
}

TEST(Interruption, OnlyTheCallingThreadIsAskedAndAllStop) {
  std::atomic<int> elsewhere{0}, asked{0}, done{0};
  const auto caller = std::this_thread::get_id();
  Interruption interruption(
      [&] {
        elsewhere += static_cast<int>(std::this_thread::get_id() != caller);
        return ++asked == 5;
      },
      0ms);
  ThreadPool pool(4, &interruption);
  const auto work = [&](std::int64_t, std::int64_t) {
    ++done;
    std::this_thread::sleep_for(1ms);
  };
  EXPECT_EQ(code_of([&] {
              const Interruption::Call call(interruption);
              pool.for_each_range(100000, 1, work);
            }),
            StatusCode::cancelled);
  EXPECT_EQ(elsewhere, 0);
  EXPECT_LT(done, 1000);
  done = 0;  // the next call begins anew
  EXPECT_EQ(code_of([&] {
              const Interruption::Call call(interruption);
              pool.for_each_range(100, 1, work);
            }),
            StatusCode::ok);
  EXPECT_EQ(done, 100);
}

// The caller has nothing to do but to wait for the other worker.
TEST(Interruption, ACallerWhoWaitsIsAskedToo) {
  std::atomic<bool> stop{false};
  Interruption interruption([&] { return stop.load(); }, 0ms);
  ThreadPool pool(2, &interruption);
  if (pool.size() < 2) GTEST_SKIP() << "the system refuses threads";
  const Interruption::Call call(interruption);
  EXPECT_EQ(code_of([&] {
              pool.run([&](int worker) {
                if (worker == 0) return;
                stop = true;
                for (;;) pool.check();
              });
            }),
            StatusCode::cancelled);
}

TEST(Interruption, ACallerWhoWaitsForTasksAndLoopsIsAskedToo) {
  std::atomic<bool> stop{false};
  Interruption interruption([&] { return stop.load(); }, 0ms);
  ThreadPool pool(2, &interruption);
  if (pool.size() < 2) GTEST_SKIP() << "the system refuses threads";
  const auto caller = std::this_thread::get_id();
  for (const bool loop : {false, true}) {
    stop = false;
    const Interruption::Call call(interruption);
    std::atomic<int> entered{0}, dropped{0};
    const auto body = [&](auto&&...) {  // by both; the caller leaves at once
      ++entered;
      while (entered < 2) std::this_thread::yield();
      if (std::this_thread::get_id() == caller) return;
      stop = true;
      for (;;) pool.check();
    };
    const auto root = [&](Recursion& recursion) {
      if (loop) return recursion.for_each_range(2, 1, body);
      for (int k = 0; k < 2; ++k)
        recursion.spawn([&](Recursion& inner) {
          body();
          inner.spawn([&](Recursion&) { ++dropped; });
        });
    };
    EXPECT_EQ(code_of([&] { Recursion::run(pool, root); }), StatusCode::cancelled);
    EXPECT_LE(dropped, 1);
  }
}

TEST(Interruption, IsAskedOncePerPeriodAndWhatItThrowsIsYes) {
  int asked = 0;
  Interruption seldom([&] { return ++asked > 0; }, 1h);
  {
    const Interruption::Call call(seldom);
    for (int k = 0; k < 1000; ++k) seldom.check();
  }
  EXPECT_EQ(asked, 0);
  Interruption throws([]() -> bool { throw 1; }, 0ms);
  throws.check();  // outside of calls nobody is asked
  const Interruption::Call call(throws);
  EXPECT_EQ(code_of([&] { throws.check(); }), StatusCode::cancelled);
}

TEST(Interruption, AnInnerCallIsPartOfTheOuterOne) {
  Interruption interruption([] { return true; }, 0ms);
  const Interruption::Call outer(interruption);
  EXPECT_EQ(code_of([&] {
              const Interruption::Call inner(interruption);
              interruption.check();
            }),
            StatusCode::cancelled);
  EXPECT_EQ(code_of([&] { interruption.check(); }), StatusCode::cancelled);
}

}  // namespace
}  // namespace espalier::base
