// Values of expressions by a stack machine; expression_parser.cpp writes its code.
#include "dynamics/model/read/expression.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/at.hpp"

namespace espalier::dynamics::model {

std::vector<std::string> Expression::functions() {
  std::vector<std::string> names = {"step", "ramp"};
  for (const auto& f : functions1()) names.emplace_back(f.name);
  for (const auto& f : functions2()) names.emplace_back(f.name);
  return names;
}

std::size_t Expression::Code::operands() const {
  switch (kind) {
    case Kind::number:
    case Kind::time:
    case Kind::quantity:
      return 0;
    case Kind::negate:
    case Kind::call1:
    case Kind::curve:
      return 1;
    case Kind::ramp:
      return 3;
    case Kind::step:
      return 5;
    default:
      return 2;
  }
}

// @param stack  the operands on top
void Expression::note_branch(const Code& c, std::span<const Jet> stack, bool timed, Branches& out) const {
  // The difference of numbers of this size is rounding.
  constexpr double kRounding = 1e-13;
  const auto which = at(c.function);
  const auto operand = [&](std::size_t from_top) { return stack[stack.size() - from_top].value; };
  const auto corner = [&](Corner kind, double zero, double size, double level) {
    if (kind == Corner::zero) out.push_back({zero, false, timed, kRounding * size});
    if (kind == Corner::whole) out.push_back({level, true, timed});
    if (kind == Corner::half) out.push_back({level + 0.5, true, timed});
  };
  switch (c.kind) {
    case Code::Kind::modulo:
      return corner(Corner::whole, 0, 0, operand(2) / operand(1));
    case Code::Kind::call1:
      return corner(functions1()[which].corner, operand(1), 0, operand(1));
    case Code::Kind::call2: {
      const double a = operand(2), b = operand(1);
      return corner(functions2()[which].corner, a - b, std::abs(a) + std::abs(b), a / b);
    }
    case Code::Kind::curve:
      if (curves_[which]->has_corners()) out.push_back({curves_[which]->level(operand(1)), true, timed});
      return;
    case Code::Kind::step:
      return out.push_back({level_of_step((operand(5) - operand(4)) / (operand(2) - operand(4))), true, timed});
    case Code::Kind::ramp:
      return out.push_back({level_of_step((operand(3) - operand(2)) / (operand(1) - operand(2))), true, timed});
    default:
      return;
  }
}

// @param out  null: branches are not asked for
Jet Expression::run(const Jet& time, std::span<const Jet> given, Branches* out) const {
  std::vector<Jet> stack;
  stack.reserve(8);
  std::vector<bool> timed;  // of the stack: no quantity takes part
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
    if (out != nullptr) {
      bool of_time = c.kind != Code::Kind::quantity;
      for (std::size_t k = c.operands(); k > 0; --k, timed.pop_back()) of_time = of_time && timed.back();
      timed.push_back(of_time);
      note_branch(c, stack, of_time, *out);
    }
    switch (c.kind) {
      case Code::Kind::number:
        stack.push_back({c.number});
        break;
      case Code::Kind::time:
        stack.push_back(time);
        break;
      case Code::Kind::quantity:
        stack.push_back(given[at(c.function)]);
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
        stack.back() = functions1()[at(c.function)].apply(stack.back());
        break;
      case Code::Kind::call2:
        binary(functions2()[at(c.function)].apply);
        break;
      case Code::Kind::curve: {
        const CurvePoint p = curves_[at(c.function)]->at(stack.back().value);
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

bool Expression::is_constant() const {
  return std::none_of(code_.begin(), code_.end(),
                      [](const Code& c) { return c.kind == Code::Kind::time || c.kind == Code::Kind::quantity; });
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
  return {part(&Jet::value, "value"), part(&Jet::rate, "rate"), part(&Jet::acceleration, "second derivative"),
          [shared](double t, Branches& out) { shared->branches(t, {}, out); }};
}

}  // namespace espalier::dynamics::model
