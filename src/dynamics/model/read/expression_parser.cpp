// From the text of an expression to postfix code, by recursive descent: a sum of products of powers.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <initializer_list>
#include <numbers>
#include <utility>

#include "base/strtod.hpp"
#include "dynamics/model/read/expression.hpp"

namespace espalier::dynamics::model {

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
    // Shown of a text that fills pages, what stands around the place is enough.
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

  struct Operator {
    char sign;
    Kind kind;
  };
  /// Operands with operators of one rank between them, from left to right.
  template <class Operand>
  void chain(Operand&& operand, std::initializer_list<Operator> operators) {
    operand();
    for (;;) {
      const auto* next =
          std::find_if(operators.begin(), operators.end(), [&](const Operator& o) { return take(o.sign); });
      if (next == operators.end()) return;
      operand();
      emit(next->kind);
    }
  }
  void sum() {
    const Level level(*this);
    chain([&] { product(); }, {{'+', Kind::add}, {'-', Kind::subtract}});
  }
  void product() {
    chain([&] { signed_factor(); }, {{'*', Kind::multiply}, {'/', Kind::divide}, {'%', Kind::modulo}});
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
    if (error == std::errc::result_out_of_range) value = base::strtod(std::string(begin, end).c_str(), nullptr);
    at_ += at(end - begin);
    emit(Kind::number, value);
  }
  void name() {
    const std::size_t start = at_;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 || text_[at_] == '_'))
      ++at_;
    const std::string word(text_.substr(start, at_ - start));
    if (at_ < text_.size() && text_[at_] == '.' && of_time_) {
      if (of_state_) return quantity(start);
      stop(
          fmt::format("'{}.' begins a quantity of the state, and what stands here is a function of t alone; forces, "
                      "moments, torques, pressures and sensors take quantities (a motor that follows the state is a "
                      "torque-motor or force-motor)",
                      excerpt(word)));
    }
    if (take('(')) return call(word, start);
    if (word == "t" && of_time_) {
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
    for (std::size_t k = 0; k < functions1().size(); ++k)
      if (functions1()[k].name == word) {
        arguments(1, word);
        return emit(Kind::call1, 0, static_cast<int>(k));
      }
    for (std::size_t k = 0; k < functions2().size(); ++k)
      if (functions2()[k].name == word) {
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

}  // namespace espalier::dynamics::model
