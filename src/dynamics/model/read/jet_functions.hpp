/// \file
/// Arithmetic and functions of a number with its first two derivatives: what expressions are made of.
#pragma once

#include <span>
#include <string_view>

namespace espalier::dynamics::model {

/// A value with its first and second derivative by time.
struct Jet {
  double value = 0, rate = 0, acceleration = 0;
};

/// f(x) with f' and f'' at x.value by the chain rule.
[[nodiscard]] inline Jet chain(const Jet& x, double f, double f1, double f2) {
  return {f, f1 * x.rate, f2 * x.rate * x.rate + f1 * x.acceleration};
}

[[nodiscard]] Jet operator+(const Jet& a, const Jet& b);
[[nodiscard]] Jet operator-(const Jet& a);
[[nodiscard]] Jet operator-(const Jet& a, const Jet& b);
[[nodiscard]] Jet operator*(const Jet& a, const Jet& b);
[[nodiscard]] Jet operator/(const Jet& a, const Jet& b);
/// a^b; a must be positive where b changes.
[[nodiscard]] Jet power(const Jet& a, const Jet& b);
/// Remainder with the sign of the divisor, so that (i - 1) % n is an index.
[[nodiscard]] Jet modulo(const Jet& a, const Jet& b);
/// s in [0, 1] -> s^3 (10 - 15 s + 6 s^2); 0 before, 1 beyond.
[[nodiscard]] Jet smooth(const Jet& x);
/// Integral of smooth(): s^4 (5/2 - 3 s + s^2), and s - 1/2 beyond 1.
[[nodiscard]] Jet smooth_integral(const Jet& x);

/// Where a function has a corner or a jump: where its argument (of min and max: the difference, of mod the quotient of
/// both) is zero, a whole number, or half way between two.
enum class Corner { none, zero, whole, half };

/// A function of one number, by its name in texts.
struct Function1 {
  std::string_view name;
  Jet (*apply)(const Jet&);
  Corner corner = Corner::none;
};
/// A function of two numbers.
struct Function2 {
  std::string_view name;
  Jet (*apply)(const Jet&, const Jet&);
  Corner corner = Corner::none;
};
/// All functions of one number, and of two.
[[nodiscard]] std::span<const Function1> functions1();
[[nodiscard]] std::span<const Function2> functions2();

}  // namespace espalier::dynamics::model
