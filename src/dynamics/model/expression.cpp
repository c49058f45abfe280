#include "dynamics/model/expression.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <numbers>
#include <utility>

namespace espalier::dynamics::model {
namespace {

/// f(x) with f' and f'' at x.value by the chain rule.
Jet chain(const Jet& x, double f, double f1, double f2) {
  return {f, f1 * x.rate, f2 * x.rate * x.rate + f1 * x.acceleration};
}

Jet operator+(const Jet& a, const Jet& b) {
  return {a.value + b.value, a.rate + b.rate, a.acceleration + b.acceleration};
}
Jet operator-(const Jet& a) { return {-a.value, -a.rate, -a.acceleration}; }
Jet operator-(const Jet& a, const Jet& b) { return a + -b; }
Jet operator*(const Jet& a, const Jet& b) {
  return {a.value * b.value, a.rate * b.value + a.value * b.rate,
          a.acceleration * b.value + 2 * a.rate * b.rate + a.value * b.acceleration};
}
Jet reciprocal(const Jet& x) {
  const double i = 1 / x.value;
  return chain(x, i, -i * i, 2 * i * i * i);
}
Jet operator/(const Jet& a, const Jet& b) {
  if (b.rate == 0 && b.acceleration == 0) return {a.value / b.value, a.rate / b.value, a.acceleration / b.value};
  return a * reciprocal(b);
}
Jet exponential(const Jet& x) {
  const double e = std::exp(x.value);
  return chain(x, e, e, e);
}
Jet logarithm(const Jet& x) { return chain(x, std::log(x.value), 1 / x.value, -1 / (x.value * x.value)); }

Jet power(const Jet& a, const Jet& b) {
  if (b.rate != 0 || b.acceleration != 0) return exponential(b * logarithm(a));
  const double n = b.value;
  const double f1 = n == 0 ? 0 : n * std::pow(a.value, n - 1),
               f2 = n == 0 || n == 1 ? 0 : n * (n - 1) * std::pow(a.value, n - 2);
  return chain(a, std::pow(a.value, n), f1, f2);
}

/// Remainder with the sign of the divisor, so that (i - 1) % n is an index.
Jet modulo(const Jet& a, const Jet& b) {
  const double turns = std::floor(a.value / b.value);
  return a - Jet{turns} * b;
}

struct Function1 {
  std::string_view name;
  Jet (*apply)(const Jet&);
};
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
    Function1{"abs", [](const Jet& x) { return x.value < 0 ? -x : x; }},
    Function1{"sign", [](const Jet& x) { return Jet{x.value > 0   ? 1.0
                                                    : x.value < 0 ? -1.0
                                                                  : 0.0}; }},
    Function1{"floor", [](const Jet& x) { return Jet{std::floor(x.value)}; }},
    Function1{"ceil", [](const Jet& x) { return Jet{std::ceil(x.value)}; }},
    Function1{"round", [](const Jet& x) { return Jet{std::round(x.value)}; }},
};

struct Function2 {
  std::string_view name;
  Jet (*apply)(const Jet&, const Jet&);
};
const std::array kFunctions2 = {
    Function2{"min", [](const Jet& a, const Jet& b) { return b.value < a.value ? b : a; }},
    Function2{"max", [](const Jet& a, const Jet& b) { return b.value > a.value ? b : a; }},
    Function2{"mod", modulo},
    Function2{"atan2",
              [](const Jet& y, const Jet& x) {
                const double r2 = x.value * x.value + y.value * y.value;
                const double w = (x.value * y.rate - y.value * x.rate) / r2;
                const double r_rate = 2 * (x.value * x.rate + y.value * y.rate) / r2;
                return Jet{std::atan2(y.value, x.value), w,
                           (x.value * y.acceleration - y.value * x.acceleration) / r2 - w * r_rate};
              }},
};

/// s in [0, 1] -> s^3 (10 - 15 s + 6 s^2).
Jet smooth(const Jet& x) {
  if (x.value <= 0) return {0};
  if (x.value >= 1) return {1};
  const double s = x.value;
  return chain(x, s * s * s * (10 + s * (-15 + 6 * s)), 30 * s * s * (1 - s) * (1 - s), 60 * s * (1 - s) * (1 - 2 * s));
}
/// Integral of smooth(): s^4 (5/2 - 3 s + s^2), and s - 1/2 beyond 1.
Jet smooth_integral(const Jet& x) {
  if (x.value <= 0) return {0};
  if (x.value >= 1) return x - Jet{0.5};
  const double s = x.value;
  return chain(x, s * s * s * s * (2.5 + s * (-3 + s)), s * s * s * (10 + s * (-15 + 6 * s)),
               30 * s * s * (1 - s) * (1 - s));
}

}  // namespace

/// Recursive descent; writes postfix code.
class ExpressionParser {
 public:
  ExpressionParser(std::string_view text, const Scope& scope, Expression::Names names, Expression& out)
      : text_(text),
        scope_(scope),
        of_time_(names != Expression::Names::numbers),
        of_state_(names == Expression::Names::state),
        out_(out) {}

  void run() {
    sum();
    skip();
    if (at_ < text_.size()) stop(fmt::format("unexpected '{}'", text_[at_]));
  }

 private:
  using Kind = Expression::Code::Kind;

  [[noreturn]] void stop(const std::string& what) const { throw Error(StatusCode::invalid_input, here() + what); }
  [[nodiscard]] std::string here() const {
    // Of a text that fills pages, what stands around the place is enough.
    constexpr std::size_t kBefore = 40, kShown = 120;
    const std::size_t first = text_.size() > kShown && at_ > kBefore ? at_ - kBefore : 0;
    const std::size_t last = std::min(text_.size(), first + kShown);
    return fmt::format("in the expression \"{}{}{}\", character {}: ", first > 0 ? "..." : "",
                       text_.substr(first, last - first), last < text_.size() ? "..." : "", at_ + 1);
  }
  void skip() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t' || text_[at_] == '\n')) ++at_;
  }
  bool take(char c) {
    skip();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  void emit(Kind kind, double number = 0, int function = 0) { out_.code_.push_back({kind, number, function}); }

  /// One level of recursion: brackets, arguments, exponents.
  struct Level {
    explicit Level(ExpressionParser& parser) : parser_(parser) {
      if (++parser_.depth_ > 400) parser_.stop("nested too deeply");
    }
    ~Level() { --parser_.depth_; }
    Level(const Level&) = delete;
    Level& operator=(const Level&) = delete;
    ExpressionParser& parser_;
  };

  void sum() {
    const Level level(*this);
    product();
    for (;;) {
      if (take('+')) {
        product();
        emit(Kind::add);
      } else if (take('-')) {
        product();
        emit(Kind::subtract);
      } else {
        break;
      }
    }
  }
  void product() {
    signed_factor();
    for (;;) {
      if (take('*')) {
        signed_factor();
        emit(Kind::multiply);
      } else if (take('/')) {
        signed_factor();
        emit(Kind::divide);
      } else if (take('%')) {
        signed_factor();
        emit(Kind::modulo);
      } else {
        return;
      }
    }
  }
  void signed_factor() {
    const Level level(*this);
    int minus = 0;
    for (;;) {
      if (take('-')) {
        ++minus;
      } else if (!take('+')) {
        break;
      }
    }
    atom();
    if (take('^')) {
      signed_factor();
      emit(Kind::power);
    }
    if (minus % 2 == 1) emit(Kind::negate);
  }
  void atom() {
    skip();
    if (at_ >= text_.size()) stop("a number is missing at the end");
    const char c = text_[at_];
    if (take('(')) {
      sum();
      if (!take(')')) stop("')' is missing");
    } else if ((c >= '0' && c <= '9') || c == '.') {
      number();
    } else if (c == '\'' && of_state_) {
      quoted();
    } else if (std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_') {
      name();
    } else {
      stop(fmt::format("unexpected '{}'", c));
    }
  }
  void number() {
    const char* begin = text_.data() + at_;
    double value = 0;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
    if (error == std::errc::invalid_argument) stop("not a number");
    // Too large or too small for a double: infinity, which is refused, or zero.
    if (error == std::errc::result_out_of_range) value = std::strtod(std::string(begin, end).c_str(), nullptr);
    at_ += static_cast<std::size_t>(end - begin);
    emit(Kind::number, value);
  }
  void name() {
    const std::size_t start = at_;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 || text_[at_] == '_'))
      ++at_;
    const std::string word(text_.substr(start, at_ - start));
    if (of_state_ && at_ < text_.size() && text_[at_] == '.') return quantity(start);
    if (take('(')) return call(word, start);
    if (word == "t" && of_time_) {
      out_.depends_on_time_ = true;
      return emit(Kind::time);
    }
    if (const auto it = scope_.find(word); it != scope_.end()) return emit(Kind::number, it->second);
    if (word == "pi") return emit(Kind::number, std::numbers::pi);
    if (word == "e") return emit(Kind::number, std::numbers::e);
    at_ = start;
    std::vector<std::string> names = {"pi"};
    if (of_time_) names.emplace_back("t");
    for (const auto& [known, value] : scope_) names.push_back(known);
    stop(fmt::format("unknown name '{}'{}", excerpt(word), suggestion(word, names)));
  }
  /// The place of a name in a list of those that others know.
  int note(std::vector<Expression::Unknown>& list, const std::string& name, std::size_t start) {
    for (std::size_t k = 0; k < list.size(); ++k)
      if (list[k].name == name) return static_cast<int>(k);
    const std::size_t end = std::exchange(at_, start);
    list.push_back({name, here()});
    at_ = end;
    return static_cast<int>(list.size()) - 1;
  }
  void quantity(std::size_t start) {
    while (at_ < text_.size() &&
           (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 || text_[at_] == '_' || text_[at_] == '.'))
      ++at_;
    emit(Kind::quantity, 0, note(out_.quantities_, std::string(text_.substr(start, at_ - start)), start));
  }
  void quoted() {
    const std::size_t start = at_++;
    const std::size_t close = text_.find('\'', at_);
    if (close == std::string_view::npos) stop("the second ' is missing");
    const std::string name(text_.substr(at_, close - at_));
    at_ = close + 1;
    emit(Kind::quantity, 0, note(out_.quantities_, name, start));
  }
  void arguments(int count, const std::string& word) {
    for (int k = 0; k < count; ++k) {
      if (k > 0 && !take(',')) stop(fmt::format("{} takes {} numbers, separated by commas", word, count));
      sum();
    }
    if (!take(')')) stop(fmt::format("')' is missing: {} takes {} number{}", word, count, count == 1 ? "" : "s"));
  }
  void call(const std::string& word, std::size_t start) {
    for (std::size_t k = 0; k < kFunctions1.size(); ++k)
      if (kFunctions1[k].name == word) {
        arguments(1, word);
        return emit(Kind::call1, 0, static_cast<int>(k));
      }
    for (std::size_t k = 0; k < kFunctions2.size(); ++k)
      if (kFunctions2[k].name == word) {
        arguments(2, word);
        return emit(Kind::call2, 0, static_cast<int>(k));
      }
    if (word == "step") {
      arguments(5, word);
      return emit(Kind::step);
    }
    if (word == "ramp") {
      arguments(3, word);
      return emit(Kind::ramp);
    }
    if (of_time_) {  // perhaps a spline: whoever knows the model will say
      const int which = note(out_.curve_names_, word, start);
      out_.curves_.resize(out_.curve_names_.size());
      arguments(1, word);
      return emit(Kind::curve, 0, which);
    }
    at_ = start;
    stop(fmt::format("unknown function '{}'{}", excerpt(word), suggestion(word, Expression::functions())));
  }

  std::string_view text_;
  const Scope& scope_;
  bool of_time_, of_state_;
  Expression& out_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

Expression::Expression(std::string_view text, const Scope& scope, Names names) : text_(text) {
  constexpr std::size_t kLongest = 100000;
  if (text.size() > kLongest)
    throw Error(StatusCode::invalid_input, fmt::format("the expression \"{}\" has {} characters; the most is {}",
                                                       excerpt(text), text.size(), kLongest));
  ExpressionParser(text, scope, names, *this).run();
}

std::vector<std::string> Expression::functions() {
  std::vector<std::string> names = {"step", "ramp"};
  for (const auto& f : kFunctions1) names.emplace_back(f.name);
  for (const auto& f : kFunctions2) names.emplace_back(f.name);
  return names;
}

Jet Expression::evaluate(const Jet& time, std::span<const Jet> given) const {
  std::vector<Jet> stack;
  stack.reserve(8);
  const auto pop = [&stack] {
    const Jet top = stack.back();
    stack.pop_back();
    return top;
  };
  const auto binary = [&](auto&& operation) {
    const Jet b = pop(), a = pop();
    stack.push_back(operation(a, b));
  };
  for (const Code& c : code_) {
    switch (c.kind) {
      case Code::Kind::number:
        stack.push_back({c.number});
        break;
      case Code::Kind::time:
        stack.push_back(time);
        break;
      case Code::Kind::quantity:
        stack.push_back(given[static_cast<std::size_t>(c.function)]);
        break;
      case Code::Kind::negate:
        stack.back() = -stack.back();
        break;
      case Code::Kind::add:
        binary([](const Jet& a, const Jet& b) { return a + b; });
        break;
      case Code::Kind::subtract:
        binary([](const Jet& a, const Jet& b) { return a - b; });
        break;
      case Code::Kind::multiply:
        binary([](const Jet& a, const Jet& b) { return a * b; });
        break;
      case Code::Kind::divide:
        binary([](const Jet& a, const Jet& b) { return a / b; });
        break;
      case Code::Kind::modulo:
        binary(modulo);
        break;
      case Code::Kind::power:
        binary(power);
        break;
      case Code::Kind::call1:
        stack.back() = kFunctions1[static_cast<std::size_t>(c.function)].apply(stack.back());
        break;
      case Code::Kind::call2:
        binary(kFunctions2[static_cast<std::size_t>(c.function)].apply);
        break;
      case Code::Kind::curve: {
        const CurvePoint p = curves_[static_cast<std::size_t>(c.function)]->at(stack.back().value);
        stack.back() = chain(stack.back(), p.y, p.slope, p.bend);
        break;
      }
      case Code::Kind::step: {
        const Jet y1 = pop(), t1 = pop(), y0 = pop(), t0 = pop(), x = pop();
        stack.push_back(y0 + (y1 - y0) * smooth((x - t0) / (t1 - t0)));
        break;
      }
      case Code::Kind::ramp: {
        const Jet t1 = pop(), t0 = pop(), x = pop();
        stack.push_back((t1 - t0) * smooth_integral((x - t0) / (t1 - t0)));
        break;
      }
    }
  }
  return stack.back();
}

TimeFunction Expression::function(const std::string& place) const {
  // The three functions share one copy of the code.
  const auto shared = std::make_shared<const Expression>(*this);
  const auto part = [shared, place](double Jet::*which, const char* name) -> std::function<double(double)> {
    return [shared, place, which, name](double t) {
      const double number = shared->jet(t).*which;
      if (!std::isfinite(number))
        throw Error(StatusCode::invalid_input, fmt::format("{}: the {} of \"{}\" is not a finite number at t = {:g}",
                                                           place, name, excerpt(shared->text_), t));
      return number;
    };
  };
  return {part(&Jet::value, "value"), part(&Jet::rate, "rate"), part(&Jet::acceleration, "second derivative")};
}

}  // namespace espalier::dynamics::model
