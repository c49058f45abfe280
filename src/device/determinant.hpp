/// \file
/// The determinant as a product of pivots.
#pragma once

#include <cmath>

namespace espalier::device {

/// Multiplies numbers without overflow and with few logarithms: the mantissa is multiplied, exponents are added.
class Determinant {
 public:
  void multiply(double factor) {
    const double magnitude = std::abs(factor);
    if (magnitude > kLarge || magnitude < kSmall) {  // rare: a factor that could overflow the product
      int exponent = 0;
      factor = std::frexp(factor, &exponent);
      exponent_ += exponent;
    }
    mantissa_ *= factor;
    if (std::abs(mantissa_) > kLarge || std::abs(mantissa_) < kSmall) normalize();
  }
  void multiply(const Determinant& other) {
    multiply(other.mantissa_);
    exponent_ += other.exponent_;
  }
  [[nodiscard]] double sign() const { return mantissa_ < 0 ? -1 : mantissa_ > 0 ? 1 : 0; }
  /// Natural logarithm of the magnitude; -infinity for zero.
  [[nodiscard]] double log() const { return std::log(std::abs(mantissa_)) + static_cast<double>(exponent_) * kLog2; }

 private:
  // The product of two numbers between these neither overflows nor underflows.
  static constexpr double kLarge = 0x1p500, kSmall = 0x1p-500;
  static constexpr double kLog2 = 0.693147180559945309417;

  void normalize() {
    int exponent = 0;
    mantissa_ = std::frexp(mantissa_, &exponent);
    exponent_ += exponent;
  }

  double mantissa_ = 1;
  long long exponent_ = 0;
};

}  // namespace espalier::device
