// The determinant as a product, against sums of logarithms in extended precision.
#include "device/determinant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace espalier::device {
namespace {

TEST(Determinant, EqualsTheSumOfLogarithms) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> exponent(-300, 300);
  for (const int count : {0, 1, 10, 100000}) {
    Determinant d;
    long double log = 0;
    double sign = 1, largest = 0;
    for (int k = 0; k < count; ++k) {
      const double factor = (random() % 3 == 0 ? -1 : 1) * std::pow(10.0, exponent(random));
      d.multiply(factor);
      log += std::log(std::abs(static_cast<long double>(factor)));
      largest = std::max(largest, static_cast<double>(std::abs(log)));
      sign = factor < 0 ? -sign : sign;
    }
    EXPECT_EQ(d.sign(), sign);
    // One rounding per product, and that of the exponents' logarithm.
    EXPECT_NEAR(d.log(), static_cast<double>(log), std::numeric_limits<double>::epsilon() * (count + 4 * largest));
  }
}

TEST(Determinant, ExtremeFactors) {
  const double tiny = std::numeric_limits<double>::denorm_min(), huge = std::numeric_limits<double>::max();
  Determinant d;
  for (int k = 0; k < 1000; ++k) d.multiply(tiny);
  EXPECT_NEAR(d.log(), 1000 * std::log(tiny), 1e-9);
  for (int k = 0; k < 1000; ++k) d.multiply(-huge);
  EXPECT_EQ(d.sign(), 1);
  EXPECT_NEAR(d.log(), 1000 * (std::log(tiny) + std::log(huge)), 1e-7);
  d.multiply(0);
  EXPECT_EQ(d.sign(), 0);
  EXPECT_EQ(d.log(), -std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace espalier::device
