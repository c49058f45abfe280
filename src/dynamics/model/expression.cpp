// Values of expressions by a stack machine; expression_parser.cpp writes its code.
#include "dynamics/model/expression.hpp"

#include <fmt/format.h>

#include <cmath>
#include <memory>

namespace espalier::dynamics::model {

std::vector<std::string> Expression::functions() {
  std::vector<std::string> names = {"step", "ramp"};
  for (const auto& f : functions1()) names.emplace_back(f.name);
  for (const auto& f : functions2()) names.emplace_back(f.name);
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
        stack.back() = functions1()[static_cast<std::size_t>(c.function)].apply(stack.back());
        break;
      case Code::Kind::call2:
        binary(functions2()[static_cast<std::size_t>(c.function)].apply);
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
