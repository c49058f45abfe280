/// \file
/// Arithmetic in model texts: numbers made of parameters, and functions of time with two exact derivatives.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dynamics/joints/time_function.hpp"
#include "dynamics/model/value.hpp"

namespace espalier::dynamics::model {

/// A value with its first and second derivative by time.
struct Jet {
  double value = 0, rate = 0, acceleration = 0;
};

/// Operators + - * / % ^ (right-associative, binds tighter than a sign before it), brackets, and the functions
///   sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs sign floor ceil round, atan2(y, x) min(a, b) max(a, b)
///   mod(a, b), step(t, t0, y0, t1, y1): quintic with zero rates and accelerations at both ends, constant outside,
///   ramp(t, t0, t1): integral of step(t, t0, 0, t1, 1), an angle whose speed is run up smoothly to 1.
/// The names pi and e are known. floor, ceil, round, sign and % have the derivatives of their smooth pieces.
class Expression {
 public:
  /// @param scope names with fixed numbers @param of_time whether the name t may be used
  /// @throws Error(invalid_input) without a place: what is wrong, and at which character
  Expression(std::string_view text, const Scope& scope, bool of_time);

  [[nodiscard]] double value(double t = 0) const { return jet(t).value; }
  [[nodiscard]] Jet jet(double t) const;
  [[nodiscard]] bool depends_on_time() const { return depends_on_time_; }
  /// For motors and loads. @param place begins the message of the Error(invalid_input) that a function throws where it
  /// (or the derivative asked for) is not a finite number
  [[nodiscard]] TimeFunction function(const std::string& place) const;

 private:
  friend class ExpressionParser;
  /// One instruction for a stack machine.
  struct Code {
    enum class Kind { number, time, negate, add, subtract, multiply, divide, modulo, power, call1, call2, step, ramp };
    Kind kind;
    double number = 0;
    int function = 0;
  };
  std::string text_;
  std::vector<Code> code_;
  bool depends_on_time_ = false;
};

}  // namespace espalier::dynamics::model
