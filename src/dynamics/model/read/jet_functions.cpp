#include "dynamics/model/read/jet_functions.hpp"

#include <array>
#include <cmath>

namespace espalier::dynamics::model {

Jet operator+(const Jet& a, const Jet& b) {
  return {a.value + b.value, a.rate + b.rate, a.acceleration + b.acceleration};
}
Jet operator-(const Jet& a) { return {-a.value, -a.rate, -a.acceleration}; }
Jet operator-(const Jet& a, const Jet& b) { return a + -b; }
Jet operator*(const Jet& a, const Jet& b) {
  return {a.value * b.value, a.rate * b.value + a.value * b.rate,
          a.acceleration * b.value + 2 * a.rate * b.rate + a.value * b.acceleration};
}

namespace {
Jet reciprocal(const Jet& x) {
  const double i = 1 / x.value;
  return chain(x, i, -i * i, 2 * i * i * i);
}
Jet exponential(const Jet& x) {
  const double e = std::exp(x.value);
  return chain(x, e, e, e);
}
Jet logarithm(const Jet& x) { return chain(x, std::log(x.value), 1 / x.value, -1 / (x.value * x.value)); }

}  // namespace

Jet operator/(const Jet& a, const Jet& b) {
  if (b.rate == 0 && b.acceleration == 0) return {a.value / b.value, a.rate / b.value, a.acceleration / b.value};
  return a * reciprocal(b);
}

Jet power(const Jet& a, const Jet& b) {
  if (b.rate != 0 || b.acceleration != 0) return exponential(b * logarithm(a));
  const double n = b.value;
  const double f1 = n == 0 ? 0 : n * std::pow(a.value, n - 1),
               f2 = n == 0 || n == 1 ? 0 : n * (n - 1) * std::pow(a.value, n - 2);
  return chain(a, std::pow(a.value, n), f1, f2);
}

Jet modulo(const Jet& a, const Jet& b) {
  const double turns = std::floor(a.value / b.value);
  return a - Jet{turns} * b;
}

Jet smooth(const Jet& x) {
  if (x.value <= 0) return {0};
  if (x.value >= 1) return {1};
  const double s = x.value;
  return chain(x, s * s * s * (10 + s * (-15 + 6 * s)), 30 * s * s * (1 - s) * (1 - s), 60 * s * (1 - s) * (1 - 2 * s));
}

Jet smooth_integral(const Jet& x) {
  if (x.value <= 0) return {0};
  if (x.value >= 1) return x - Jet{0.5};
  const double s = x.value;
  return chain(x, s * s * s * s * (2.5 + s * (-3 + s)), s * s * s * (10 + s * (-15 + 6 * s)),
               30 * s * s * (1 - s) * (1 - s));
}

namespace {
constexpr double inverse_square_root(double x) { return 1 / std::sqrt(x); }

const std::array kFunctions1 = {
    Function1{"sin", [](const Jet& x) { return chain(x, std::sin(x.value), std::cos(x.value), -std::sin(x.value)); }},
    Function1{"cos", [](const Jet& x) { return chain(x, std::cos(x.value), -std::sin(x.value), -std::cos(x.value)); }},
    Function1{"tan",
              [](const Jet& x) {
                const double t = std::tan(x.value), d = 1 + t * t;
                return chain(x, t, d, 2 * t * d);
              }},
    Function1{"asin",
              [](const Jet& x) {
                const double d = inverse_square_root(1 - x.value * x.value);
                return chain(x, std::asin(x.value), d, x.value * d * d * d);
              }},
    Function1{"acos",
              [](const Jet& x) {
                const double d = inverse_square_root(1 - x.value * x.value);
                return chain(x, std::acos(x.value), -d, -x.value * d * d * d);
              }},
    Function1{"atan",
              [](const Jet& x) {
                const double d = 1 / (1 + x.value * x.value);
                return chain(x, std::atan(x.value), d, -2 * x.value * d * d);
              }},
    Function1{"sinh",
              [](const Jet& x) { return chain(x, std::sinh(x.value), std::cosh(x.value), std::sinh(x.value)); }},
    Function1{"cosh",
              [](const Jet& x) { return chain(x, std::cosh(x.value), std::sinh(x.value), std::cosh(x.value)); }},
    Function1{"tanh",
              [](const Jet& x) {
                const double t = std::tanh(x.value), d = 1 - t * t;
                return chain(x, t, d, -2 * t * d);
              }},
    Function1{"exp", exponential},
    Function1{"log", logarithm},
    Function1{"sqrt",
              [](const Jet& x) {
                const double s = std::sqrt(x.value);
                if (x.rate == 0 && x.acceleration == 0) return Jet{s};
                return chain(x, s, 0.5 / s, -0.25 / (s * x.value));
              }},
    Function1{"abs", [](const Jet& x) { return x.value < 0 ? -x : x; }, Corner::zero},
    Function1{"sign", [](const Jet& x) { return Jet{x.value > 0   ? 1.0
                                                    : x.value < 0 ? -1.0
                                                                  : 0.0}; }, Corner::zero},
    Function1{"floor", [](const Jet& x) { return Jet{std::floor(x.value)}; }, Corner::whole},
    Function1{"ceil", [](const Jet& x) { return Jet{std::ceil(x.value)}; }, Corner::whole},
    Function1{"round", [](const Jet& x) { return Jet{std::round(x.value)}; }, Corner::half},
};

const std::array kFunctions2 = {
    Function2{"min", [](const Jet& a, const Jet& b) { return b.value < a.value ? b : a; }, Corner::zero},
    Function2{"max", [](const Jet& a, const Jet& b) { return b.value > a.value ? b : a; }, Corner::zero},
    Function2{"mod", modulo, Corner::whole},
    Function2{"atan2",
              [](const Jet& y, const Jet& x) {
                const double r2 = x.value * x.value + y.value * y.value;
                const double w = (x.value * y.rate - y.value * x.rate) / r2;
                const double r_rate = 2 * (x.value * x.rate + y.value * y.rate) / r2;
                return Jet{std::atan2(y.value, x.value), w,
                           (x.value * y.acceleration - y.value * x.acceleration) / r2 - w * r_rate};
              }},
};
}  // namespace

std::span<const Function1> functions1() { return kFunctions1; }
std::span<const Function2> functions2() { return kFunctions2; }

}  // namespace espalier::dynamics::model
