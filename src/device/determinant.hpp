/// \file
/// The determinant as a product of pivots.
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <span>

namespace espalier::device {

/// Multiplies numbers without overflow and with few logarithms: the mantissa is multiplied, exponents are added.
class Determinant {
 public:
  Determinant() = default;
  Determinant(double mantissa, long long exponent) : mantissa_(mantissa), exponent_(exponent) {}
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
  /// The magnitudes of complex numbers are multiplied as above, and what is left of them is kept apart.
  void multiply(std::complex<double> factor) {
    const double magnitude = std::abs(factor);
    multiply(magnitude);
    if (!(magnitude > 0)) return;
    phase_ *= factor / magnitude;
    phase_ /= std::abs(phase_);
  }
  /// All factors; four at once where they are of ordinary size, so that one chain of products does not wait for each.
  template <class T>
  void multiply(std::span<const T> factors) {
    const std::size_t fours = factors.size() / 4 * 4;
    for (std::size_t k = 0; k < fours; k += 4) {
      const double a = static_cast<double>(factors[k]) * static_cast<double>(factors[k + 1]);
      const double b = static_cast<double>(factors[k + 2]) * static_cast<double>(factors[k + 3]);
      if (moderate(a) && moderate(b)) {
        multiply(a * b);
      } else {
        for (const T factor : factors.subspan(k, 4)) multiply(static_cast<double>(factor));
      }
    }
    for (const T factor : factors.subspan(fours)) multiply(static_cast<double>(factor));
  }
  void multiply(const Determinant& other) {
    multiply(other.mantissa_);
    exponent_ += other.exponent_;
    if (other.phase_ != 1.0) phase_ *= other.phase_;
  }
  /// The product of the directions of the complex factors, beside sign(); 1 without any.
  [[nodiscard]] std::complex<double> phase() const { return phase_; }
  [[nodiscard]] double sign() const { return mantissa_ < 0 ? -1 : mantissa_ > 0 ? 1 : 0; }
  /// Natural logarithm of the magnitude; -infinity for zero.
  [[nodiscard]] double log() const { return std::log(std::abs(mantissa_)) + static_cast<double>(exponent_) * kLog2; }

 private:
  // The product of two numbers between these neither overflows nor underflows.
  static constexpr double kLarge = 0x1p500, kSmall = 0x1p-500;
  static constexpr double kLog2 = 0.693147180559945309417;

  // The product of two such numbers is between kSmall and kLarge.
  static bool moderate(double x) { return std::abs(x) < 0x1p250 && std::abs(x) > 0x1p-250; }
  void normalize() {
    int exponent = 0;
    mantissa_ = std::frexp(mantissa_, &exponent);
    exponent_ += exponent;
  }

  double mantissa_ = 1;
  long long exponent_ = 0;
  std::complex<double> phase_ = 1;
};

}  // namespace espalier::device
