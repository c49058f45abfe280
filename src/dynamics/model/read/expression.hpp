/// \file
/// Arithmetic in model texts: numbers made of parameters, functions of time with two exact derivatives, and functions
/// of quantities of the state.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/joints/time_function.hpp"
#include "dynamics/model/build/curve.hpp"
#include "dynamics/model/read/jet_functions.hpp"
#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {

/// Operators + - * / % ^ (right-associative, binds tighter than a sign before it), brackets, and the functions
///   sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs sign floor ceil round, atan2(y, x) min(a, b) max(a, b)
///   mod(a, b), step(t, t0, y0, t1, y1): quintic with zero rates and accelerations at both ends, constant outside,
///   ramp(t, t0, t1): integral of step(t, t0, 0, t1, 1), an angle whose speed is run up smoothly to 1.
/// The names pi and e are known. floor, ceil, round, sign and % have the derivatives of their smooth pieces.
class Expression {
 public:
  /// What may be named beside the numbers of the scope.
  enum class Names {
    numbers,  ///< nothing
    time,     ///< t, and splines: NAME(x)
    state     ///< quantities too: bob.position.x, or 'left-rod.position.x' where a name has a '-'
  };
  /// A name that the text uses and somebody else has to know. Equal names stand once.
  struct Unknown {
    std::string name;
    std::string complaint;  ///< "in the expression ..., character N: ", for the message that it is not known
  };

  Expression() = default;
  /// @param scope names with fixed numbers @param of_time whether the name t may be used
  /// @throws Error(invalid_input) without a place: what is wrong, and at which character
  Expression(std::string_view text, const Scope& scope, bool of_time)
      : Expression(text, scope, of_time ? Names::time : Names::numbers) {}
  Expression(std::string_view text, const Scope& scope, Names names);

  [[nodiscard]] double value(double t = 0) const { return jet(t).value; }
  [[nodiscard]] Jet jet(double t) const { return evaluate({t, 1, 0}, {}); }
  /// @param given one jet for each of quantities(). The derivatives are those along the one that time and quantities
  /// have.
  [[nodiscard]] Jet evaluate(const Jet& time, std::span<const Jet> given) const { return run(time, given, nullptr); }
  /// Appends where the text has corners and jumps (abs, sign, min, max, floor, ceil, round, mod, %, the ends of step
  /// and ramp, corners of splines). @param given as for evaluate()
  void branches(double t, std::span<const Jet> given, Branches& out) const { (void)run({t, 0, 0}, given, &out); }
  [[nodiscard]] const std::string& text() const { return text_; }
  /// Whether it names neither t nor a quantity.
  [[nodiscard]] bool is_constant() const;
  [[nodiscard]] const std::vector<Unknown>& quantities() const { return quantities_; }
  /// Functions that may be splines; each has to be given by set_curve() before the expression is evaluated.
  [[nodiscard]] const std::vector<Unknown>& curves() const { return curve_names_; }
  void set_curve(std::size_t k, CurvePtr curve) { curves_.at(k) = std::move(curve); }
  /// Names of all functions, for suggestions.
  [[nodiscard]] static std::vector<std::string> functions();
  /// For motors and loads. @param place begins the message of the Error(invalid_input) that a function throws where it
  /// (or the derivative asked for) is not a finite number
  [[nodiscard]] TimeFunction function(const std::string& place) const;

 private:
  friend class ExpressionParser;
  /// One instruction for a stack machine.
  struct Code {
    enum class Kind {
      number,
      time,
      quantity,
      negate,
      add,
      subtract,
      multiply,
      divide,
      modulo,
      power,
      call1,
      call2,
      curve,
      step,
      ramp
    };
    Kind kind;
    double number = 0;
    int function = 0;  ///< of functions, quantities and curves: which
    [[nodiscard]] std::size_t operands() const;
  };
  [[nodiscard]] Jet run(const Jet& time, std::span<const Jet> given, Branches* out) const;
  void note_branch(const Code& c, std::span<const Jet> stack, bool timed, Branches& out) const;

  std::string text_;
  std::vector<Code> code_;
  std::vector<Unknown> quantities_, curve_names_;
  std::vector<CurvePtr> curves_;
};

}  // namespace espalier::dynamics::model
