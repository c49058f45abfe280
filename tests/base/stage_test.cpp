// How far a call is. Truth: what the stages were told, and hand-made estimates.
#include "base/stage.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <thread>
#include <vector>

namespace espalier::base {
namespace {

TEST(Stage, WithoutAListenerNothingHappens) {
  Stage stage("work", 10, "parts");
  stage.reach(3);
  stage.add(1);
  EXPECT_EQ(Stage::current("work"), nullptr);
  EXPECT_EQ(progress().phase, "");
  EXPECT_EQ(telling(nullptr), nullptr);
}

TEST(Stage, TheOutermostThatCountsIsToldAndWhatItIsAt) {
  std::vector<ProgressReport> told;
  const ProgressListener listener([&](const ProgressReport& r) { told.push_back(r); }, 0);
  const Stage outer("command");
  {
    Stage modes("modes", 5, "modes");
    modes.reach(2);
    modes.reach(1);  // never less
    Stage factor("factorization", 200, "flops");
    factor.add_share(0.25);
    ProgressReport r = progress();
    EXPECT_EQ(r.phase, "modes");
    EXPECT_EQ(r.done, 2);
    EXPECT_EQ(r.total, 5);
    EXPECT_EQ(r.unit, "modes");
    EXPECT_EQ(r.inside, "factorization");
    EXPECT_EQ(r.inside_done, 50);
    EXPECT_EQ(r.inside_total, 200);
    EXPECT_EQ(Stage::current("factorization"), &factor);
    EXPECT_EQ(Stage::current("modes"), nullptr);
    factor.add(1e6);
    EXPECT_EQ(progress().inside_done, 200);  // not more than there is
  }
  EXPECT_EQ(progress().phase, "command");
  EXPECT_TRUE(std::isnan(progress().seconds_left));
  EXPECT_EQ(progress().total, 0);
  ASSERT_GE(told.size(), 4U);
  EXPECT_EQ(told.front().phase, "command");
}

TEST(Stage, OtherThreadsAddButAreNotHeard) {
  int told = 0;
  const auto here = std::this_thread::get_id();
  const ProgressListener listener(
      [&](const ProgressReport&) {
        ++told;
        EXPECT_EQ(std::this_thread::get_id(), here);
      },
      0);
  Stage stage("work", 4000, "parts");
  std::vector<std::thread> threads;
  for (int k = 0; k < 4; ++k)
    threads.emplace_back([&] {
      const Stage own("other", 3, "things");
      for (int i = 0; i < 1000; ++i) stage.add(1);
      tell_progress();
    });
  for (std::thread& t : threads) t.join();
  const int before = told;
  EXPECT_EQ(progress().done, 4000);
  EXPECT_EQ(progress().seconds_left, 0);
  EXPECT_TRUE(telling([] { return true; })());
  EXPECT_FALSE(telling(nullptr)());
  EXPECT_EQ(told, before + 2);
}

TEST(Stage, SecondsLeftBeginWithThePrediction) {
  const ProgressListener listener(nullptr);
  Stage stage("factorization", 100, "flops", 1000);
  EXPECT_NEAR(progress().seconds_left, 1000, 60);
  stage.reach(10);
  ProgressReport r = progress();
  EXPECT_NEAR(r.seconds_left, 0.7 * 1000 + 0.3 * r.seconds / 0.1 - r.seconds, 1e-9);
  stage.reach(60);  // in no time: the prediction was wrong
  r = progress();
  EXPECT_NEAR(r.seconds_left, r.seconds * 0.4 / 0.6, 1e-9);
}

TEST(Stage, AnInnerListenerTakesThePlaceOfTheOuter) {
  std::string heard;
  const ProgressListener outer([&](const ProgressReport&) { heard += "o"; }, 0);
  {
    const ProgressListener inner([&](const ProgressReport&) { heard += "i"; }, 0);
    const Stage stage("a");
  }
  const Stage stage("b");
  EXPECT_EQ(heard, "iio");
}

}  // namespace
}  // namespace espalier::base
