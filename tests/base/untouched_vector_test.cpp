#include "base/untouched_vector.hpp"

#include <gtest/gtest.h>

#include <span>

namespace espalier::base {
namespace {

// What resize() adds is not looked at: reading it would be undefined.
TEST(UntouchedVector, KeepsWhatWasWrittenAndTakesValues) {
  UntouchedVector<double> x;
  x.resize(3);
  for (double& value : x) value = 2.5;
  x.resize(100000);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(x[i], 2.5) << i;
  x.resize(4);
  x.resize(6, 7.0);
  EXPECT_EQ(x[4], 7);
  EXPECT_EQ(x[5], 7);
  x.push_back(8);
  EXPECT_EQ(x.back(), 8);
  const UntouchedVector<int> filled(5, 3);
  for (const int value : filled) EXPECT_EQ(value, 3);
  const UntouchedVector<int> copied = filled;
  EXPECT_EQ(copied, filled);
  EXPECT_EQ(std::span<const int>(copied).size(), 5U);
}

}  // namespace
}  // namespace espalier::base
