// Tasks beside the caller: their order, their failures, how many may wait.
#include "base/background.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace espalier::base {
namespace {

TEST(Background, DoesAllInTheirOrder) {
  std::vector<int> done;
  {
    Background background;
    for (int k = 0; k < 100; ++k) background.enqueue([&done, k] { done.push_back(k); });
    background.wait();
    EXPECT_EQ(done.size(), 100U);
    for (int k = 100; k < 103; ++k) background.enqueue([&done, k] { done.push_back(k); });
  }  // the destructor waits, too
  ASSERT_EQ(done.size(), 103U);
  for (int k = 0; k < 103; ++k) EXPECT_EQ(done[static_cast<std::size_t>(k)], k);
}

TEST(Background, AFailureIsThrownOnceAndNothingIsDoneMeanwhile) {
  Background background(8);
  std::atomic<int> done = 0;
  background.enqueue([] { throw std::runtime_error("full"); });
  // Either call may hear of it; what was enqueued behind it is dropped.
  const auto all = [&] {
    for (int k = 0; k < 4; ++k) background.enqueue([&done] { ++done; });
    background.wait();
  };
  try {
    all();
    FAIL() << "the failure was lost";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "full");
  }
  EXPECT_EQ(done, 0);
  background.enqueue([&done] { ++done; });
  background.wait();
  EXPECT_EQ(done, 1) << "it works again";
}

TEST(Background, AFailureAtTheEndEndsNothing) {
  Background background;
  background.enqueue([] { throw std::runtime_error("lost"); });
}

TEST(Background, NoMoreThanAFewWait) {
  Background background(2);
  std::atomic<bool> go = false;
  std::atomic<int> begun = 0;
  background.enqueue([&] {
    ++begun;
    while (!go) std::this_thread::yield();
  });
  while (begun == 0) std::this_thread::yield();
  background.enqueue([&] { ++begun; });
  background.enqueue([&] { ++begun; });
  std::atomic<bool> fourth = false;
  std::thread caller([&] {
    background.enqueue([&] { ++begun; });
    fourth = true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_FALSE(fourth) << "a third one waits already";
  go = true;
  caller.join();
  background.wait();
  EXPECT_EQ(begun, 4);
}

}  // namespace
}  // namespace espalier::base
