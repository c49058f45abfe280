#include "dynamics/model/expand.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/model/expression.hpp"

namespace espalier::dynamics::model {
namespace {

using ScopePtr = std::shared_ptr<const Scope>;

double evaluate(const std::string& text, const Scope& scope, const Place& place) {
  double value = 0;
  try {
    value = Expression(text, scope, false).value();
  } catch (const Error& error) {
    fail(place, error.what());
  }
  if (!std::isfinite(value)) fail(place, fmt::format("\"{}\" is not a finite number", text));
  return value;
}

double number(const Value& value, const Scope& scope) {
  if (value.type == Value::Type::text) return evaluate(value.text, scope, value.place);
  if (value.type != Value::Type::integer && value.type != Value::Type::real)
    fail(value.place, fmt::format("must be a number or an expression, not {}", name_of(value.type)));
  if (!std::isfinite(value.real)) fail(value.place, "must be a finite number");
  return value.real;
}

Scope read_parameters(const Value& root) {
  Scope scope;
  const Value* parameters = root.find("parameters");
  if (parameters == nullptr) return scope;
  if (!parameters->is_table()) fail(parameters->place, "must be a table of numbers");
  for (const auto& [name, value] : parameters->entries) {
    if (name == "t" || name == "pi" || name == "e")
      fail(value.place, fmt::format("the name '{}' is taken; choose another", name));
    scope[name] = number(value, scope);
  }
  return scope;
}

/// Replaces every {expression}.
std::string fill_in(const std::string& text, const Scope& scope, const Place& place) {
  std::string result;
  std::size_t at = 0;
  for (;;) {
    const std::size_t open = text.find('{', at);
    result += text.substr(at, open == std::string::npos ? open : open - at);
    if (open == std::string::npos) return result;
    const std::size_t close = text.find('}', open);
    if (close == std::string::npos) fail(place, fmt::format("'}}' is missing in \"{}\"", text));
    result += number_text(evaluate(text.substr(open + 1, close - open - 1), scope, place));
    at = close + 1;
  }
}

/// A copy with placeholders filled in and the scope noted.
Value instantiate(const Value& value, const ScopePtr& scope, const std::string& path) {
  Value copy = value;
  copy.scope = scope;
  copy.place.path = path;
  if (value.type == Value::Type::text) copy.text = fill_in(value.text, *scope, value.place);
  for (std::size_t k = 0; k < value.items.size(); ++k)
    copy.items[k] = instantiate(value.items[k], scope, fmt::format("{}[{}]", path, k));
  for (std::size_t k = 0; k < value.entries.size(); ++k) {
    const std::string name = fill_in(value.entries[k].first, *scope, value.entries[k].second.place);
    copy.entries[k] = {name, instantiate(value.entries[k].second, scope, fmt::format("{}.{}", path, name))};
  }
  return copy;
}

void note_scope(Value& value, const ScopePtr& scope) {
  value.scope = scope;
  for (Value& item : value.items) note_scope(item, scope);
  for (auto& entry : value.entries) note_scope(entry.second, scope);
}

constexpr std::array<std::string_view, 4> kRepeatable = {"bodies", "markers", "joints", "forces"};

void add_section(Value& root, const std::string& section, const Value& items, const ScopePtr& scope) {
  if (!items.is_table()) fail(items.place, "must hold tables with names");
  Value* target = root.find(section);
  if (target == nullptr) {
    root.entries.emplace_back(section, Value{});
    target = &root.entries.back().second;
    target->place = {items.place.file, items.place.line, section};
    target->scope = scope;
  }
  for (const auto& [name, value] : items.entries) {
    const std::string filled = fill_in(name, *scope, value.place);
    if (const Value* present = target->find(filled); present != nullptr)
      fail(value.place,
           fmt::format("'{}.{}' is there already (line {}); put the index into the name, for instance {}{{i}}", section,
                       filled, present->place.line, name));
    target->entries.emplace_back(filled, instantiate(value, scope, fmt::format("{}.{}", section, filled)));
  }
}

void repeat(Value& root, const Value& block, const Scope& parameters) {
  if (!block.is_table()) fail(block.place, "must be a table ([[repeat]])");
  std::string index = "i";
  double from = 0, to = -1;
  bool bounded = false;
  for (const auto& [key, value] : block.entries) {
    if (key == "index" && value.type == Value::Type::text) {
      index = value.text;
    } else if (key == "from") {
      from = number(value, parameters);
    } else if (key == "to") {
      to = number(value, parameters);
      bounded = true;
    } else if (std::find(kRepeatable.begin(), kRepeatable.end(), key) == kRepeatable.end()) {
      fail(value.place, fmt::format("unknown key{}",
                                    suggestion(key, {"index", "from", "to", "bodies", "markers", "joints", "forces"})));
    }
  }
  if (!bounded) fail(block.place, "needs 'to', the last value of the index");
  constexpr double kMost = 1e6;
  if (from != std::floor(from) || to != std::floor(to) || to - from > kMost)
    fail(block.place,
         fmt::format("'from' and 'to' must be whole numbers less than {} apart, not {} and {}", kMost, from, to));
  for (double i = from; i <= to; ++i) {
    auto scope = std::make_shared<Scope>(parameters);
    (*scope)[index] = i;
    for (const auto& [key, value] : block.entries)
      if (std::find(kRepeatable.begin(), kRepeatable.end(), key) != kRepeatable.end())
        add_section(root, key, value, scope);
  }
}

void remove(Value& root, std::string_view key) {
  std::erase_if(root.entries, [&](const auto& entry) { return entry.first == key; });
}

}  // namespace

std::string number_text(double value) {
  return value == std::floor(value) && std::abs(value) < 1e15 ? fmt::format("{:.0f}", value) : fmt::format("{}", value);
}

void expand(Value& root, const std::vector<std::string>& overrides) {
  for (const std::string& assignment : overrides) set_value(root, assignment);
  const auto parameters = std::make_shared<const Scope>(read_parameters(root));
  note_scope(root, parameters);
  for (auto& [name, value] : root.entries)
    if (name != "parameters" && name != "repeat") value = instantiate(value, parameters, name);
  if (const Value* found = root.find("repeat"); found != nullptr) {
    const Value blocks = *found;
    if (blocks.type != Value::Type::array)
      fail(blocks.place, "write [[repeat]] with two brackets: it is a list of blocks");
    for (const Value& block : blocks.items) repeat(root, block, *parameters);
  }
  remove(root, "repeat");
  remove(root, "parameters");
}

}  // namespace espalier::dynamics::model
