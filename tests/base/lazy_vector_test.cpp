#include "base/lazy_vector.hpp"

#include <gtest/gtest.h>

#include <span>
#include <utility>
#include <vector>

namespace espalier::base {
namespace {

const std::vector<int>& filled_by_hand() {
  static const std::vector<int> list{1, 2, 3};
  return list;
}

// What resize() adds is not looked at: reading it would be undefined.
TEST(LazyVector, KeepsWhatWasWrittenAndTakesValues) {
  LazyVector<double> x;
  x.resize(3);
  for (double& value : x) value = 2.5;
  x.resize(100000);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(x[i], 2.5) << i;
  x.resize(4);
  x.append({7, 8});
  EXPECT_EQ(x[4], 7);
  EXPECT_EQ(x[5], 8);
  x.push_back(x[0]);
  EXPECT_EQ(x.back(), 2.5);
  x.append(filled_by_hand().begin(), filled_by_hand().end());
  EXPECT_EQ(x.size(), 10U);
  EXPECT_EQ(x.back(), 3);
  const LazyVector<int> filled(5, 3);
  for (const int value : filled) EXPECT_EQ(value, 3);
  const LazyVector<int> copied = filled;
  EXPECT_EQ(copied, filled);
  EXPECT_EQ(std::span<const int>(copied).size(), 5U);
}

TEST(LazyVector, MovesAndGrowsFromNothing) {
  LazyVector<int> x;
  EXPECT_TRUE(x.empty());
  EXPECT_EQ(x, LazyVector<int>());
  for (int k = 0; k < 1000; ++k) x.push_back(k);
  LazyVector<int> y = std::move(x);
  ASSERT_EQ(y.size(), 1000U);
  for (int k = 0; k < 1000; ++k) ASSERT_EQ(y[static_cast<std::size_t>(k)], k);
  x = y;
  x.assign(2, x[7]);
  EXPECT_EQ(x, (LazyVector<int>{7, 7}));
  const LazyVector<int>& same = x;
  x = same;
  EXPECT_EQ(x.size(), 2U);
  x = std::move(y);
  EXPECT_EQ(x.size(), 1000U);
  x.clear();
  x.reserve(10);
  EXPECT_TRUE(x.empty());
}

}  // namespace
}  // namespace espalier::base
