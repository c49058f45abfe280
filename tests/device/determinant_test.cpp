// The determinant as a product, against sums of logarithms in extended precision.
#include "device/determinant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <vector>

namespace espalier::device {
namespace determinant_test {

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

// The same factors at once and one after another; one of them extreme in some pieces.
TEST(Determinant, ListsEqualSingleFactors) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> exponent(-300, 300);
  for (const std::size_t count : {0U, 1U, 255U, 256U, 257U, 5000U}) {
    for (const double extreme :
         {1.0, std::numeric_limits<double>::denorm_min(), std::numeric_limits<double>::max(), 0.0}) {
      std::vector<double> factors(count);
      for (double& f : factors) f = (random() % 3 == 0 ? -1 : 1) * std::pow(10.0, exponent(random));
      if (count > 0) factors[count / 2] = extreme;
      Determinant one, list;
      double largest = 0;  // of the partial logarithms
      for (const double f : factors) {
        one.multiply(f);
        if (one.sign() != 0) largest = std::max(largest, std::abs(one.log()));
      }
      list.multiply(std::span<const double>(factors));
      EXPECT_EQ(list.sign(), one.sign());
      if (one.sign() == 0) {
        EXPECT_EQ(list.log(), one.log());
      } else {
        EXPECT_NEAR(list.log(), one.log(),
                    std::numeric_limits<double>::epsilon() * (2.0 * static_cast<double>(count) + 4 * largest));
      }
    }
  }
  Determinant single;
  const std::vector<float> floats{1.5F, -2.0F, 1e-40F};
  single.multiply(std::span<const float>(floats));
  EXPECT_NEAR(single.log(), std::log(3.0) + std::log(static_cast<double>(1e-40F)), 1e-13);
  EXPECT_EQ(single.sign(), -1);
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

}  // namespace determinant_test
}  // namespace espalier::device
