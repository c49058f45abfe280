#include "dynamics/model/read/expand.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "dynamics/model/read/expression.hpp"
#include "dynamics/model/units/apply_units.hpp"

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
  if (!std::isfinite(value)) fail(place, fmt::format("\"{}\" is not a finite number", excerpt(text)));
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
  const std::optional<UnitSystem> units = stated_units(root);
  for (const auto& [name, value] : parameters->entries) {
    if (name == "t" || name == "pi" || name == "e")
      fail(value.place, fmt::format("the name '{}' is taken; choose another", name));
    const std::optional<double> measured = parameter_with_unit(value, units);
    scope[name] = measured ? *measured : number(value, scope);
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
    if (close == std::string::npos) fail(place, fmt::format("'}}' is missing in \"{}\"", excerpt(text)));
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

constexpr std::array<std::string_view, 8> kRepeatable = {"bodies",   "markers",  "joints",  "forces",
                                                         "surfaces", "contacts", "sensors", "events"};

/// Number of values in a tree, its root included.
std::int64_t count_values(const Value& value) {
  std::int64_t count = 1;
  for (const Value& item : value.items) count += count_values(item);
  for (const auto& entry : value.entries) count += count_values(entry.second);
  return count;
}

/// Writes out [[repeat]] blocks.
class Repeater {
 public:
  Repeater(Value& root, const Scope& parameters) : root_(root), parameters_(parameters) {}

  /// Before anything is written out: whether all blocks together stay within bounds.
  void check(const Value& block) {
    if (!block.is_table()) fail(block.place, "must be a table ([[repeat]])");
    const Repetition range = read_range(block);
    std::int64_t values = 0;
    for (const auto& [key, value] : block.entries)
      if (repeatable(key)) values += count_values(value);
    values_ += static_cast<double>(values) * std::max(0.0, range.to - range.from + 1);
    constexpr double kMostValues = 2e6;  // some hundred megabytes
    if (values_ > kMostValues)
      fail(block.place,
           fmt::format("all repetitions together make {:.0f} values; the most is {:.0f}", values_, kMostValues));
  }

  /// @pre check() of all blocks
  void repeat(const Value& block) {
    const Repetition range = read_range(block);
    for (double i = range.from; i <= range.to; ++i) {
      auto scope = std::make_shared<Scope>(parameters_);
      (*scope)[range.index] = i;
      for (const auto& [key, value] : block.entries)
        if (repeatable(key)) add_section(key, value, scope);
    }
  }

 private:
  struct Repetition {
    std::string index = "i";
    double from = 0, to = -1;
  };

  static bool repeatable(const std::string& key) {
    return std::find(kRepeatable.begin(), kRepeatable.end(), key) != kRepeatable.end();
  }

  [[nodiscard]] Repetition read_range(const Value& block) const {
    Repetition range;
    bool bounded = false;
    for (const auto& [key, value] : block.entries) {
      if (key == "index" && value.type == Value::Type::text) {
        range.index = value.text;
      } else if (key == "from") {
        range.from = number(value, parameters_);
      } else if (key == "to") {
        range.to = number(value, parameters_);
        bounded = true;
      } else if (!repeatable(key)) {
        fail(value.place,
             fmt::format("unknown key{}", suggestion(key, {"index", "from", "to", "bodies", "markers", "joints",
                                                           "forces", "surfaces", "contacts", "sensors", "events"})));
      }
    }
    if (!bounded) fail(block.place, "needs 'to', the last value of the index");
    constexpr double kMost = 1e6, kLargest = 1e15;  // below 2^53: the next number is another one
    const auto good = [](double x) { return x == std::floor(x) && std::abs(x) <= kLargest; };
    if (!good(range.from) || !good(range.to) || range.to - range.from > kMost)
      fail(block.place, fmt::format("'from' and 'to' must be whole numbers up to {}, less than {} apart, not {} and {}",
                                    kLargest, kMost, range.from, range.to));
    return range;
  }

  void add_section(const std::string& section, const Value& items, const ScopePtr& scope) {
    if (!items.is_table()) fail(items.place, "must hold tables with names");
    Value* target = root_.find(section);
    if (target == nullptr) {
      root_.entries.emplace_back(section, Value{});
      target = &root_.entries.back().second;
      target->place = {items.place.file, items.place.line, section};
      target->scope = scope;
    }
    auto [lines, fresh] = lines_.try_emplace(section);
    if (fresh)
      for (const auto& [name, value] : target->entries) lines->second.emplace(name, value.place.line);
    for (const auto& [name, value] : items.entries) {
      const std::string filled = fill_in(name, *scope, value.place);
      const auto [present, added] = lines->second.emplace(filled, value.place.line);
      if (!added)
        fail(value.place,
             fmt::format("'{}.{}' is there already (line {}); put the index into the name, for instance {}{{i}}",
                         section, filled, present->second, name));
      target->entries.emplace_back(filled, instantiate(value, scope, fmt::format("{}.{}", section, filled)));
    }
  }

  Value& root_;
  const Scope& parameters_;
  std::map<std::string, std::unordered_map<std::string, int>> lines_;  // of the entries of each section, by name
  double values_ = 0;                                                  // made by all blocks
};

/// Whether a path leads to a body, joint, ... that does not stand in the text, where there are repetitions that may
/// make it.
bool made_by_repetition(const Value& root, const std::string& path) {
  const std::size_t dot = path.find('.');
  if (root.find("repeat") == nullptr || dot == std::string::npos) return false;
  const std::string section = path.substr(0, dot);
  if (std::find(kRepeatable.begin(), kRepeatable.end(), section) == kRepeatable.end()) return false;
  const Value* table = root.find(section);
  return table == nullptr || table->find(path.substr(dot + 1, path.find('.', dot + 1) - dot - 1)) == nullptr;
}

void remove(Value& root, std::string_view key) {
  std::erase_if(root.entries, [&](const auto& entry) { return entry.first == key; });
}

}  // namespace

std::string number_text(double value) {
  return value == std::floor(value) && std::abs(value) < 1e15 ? fmt::format("{:.0f}", value) : fmt::format("{}", value);
}

void expand(Value& root, const std::vector<std::string>& overrides) {
  // What repetition will make cannot be set before it is there.
  std::vector<Assignment> late;
  for (const std::string& text : overrides) {
    Assignment a = parse_assignment(text);
    if (made_by_repetition(root, a.path)) {
      late.push_back(std::move(a));
    } else {
      set_value(root, a.path, std::move(a.value));
    }
  }
  const auto parameters = std::make_shared<const Scope>(read_parameters(root));
  note_scope(root, parameters);
  for (auto& [name, value] : root.entries)
    if (name != "parameters" && name != "repeat") value = instantiate(value, parameters, name);
  if (const Value* found = root.find("repeat"); found != nullptr) {
    const Value blocks = *found;
    if (blocks.type != Value::Type::array)
      fail(blocks.place, "write [[repeat]] with two brackets: it is a list of blocks");
    Repeater repeater(root, *parameters);
    for (const Value& block : blocks.items) repeater.check(block);
    for (const Value& block : blocks.items) repeater.repeat(block);
  }
  for (Assignment& a : late) {
    a.value = instantiate(a.value, parameters, a.path);
    set_value(root, a.path, std::move(a.value));
  }
  remove(root, "repeat");
  remove(root, "parameters");
  apply_units(root);
}

double number_at(Value root, const std::vector<std::string>& overrides, const std::string& path) {
  const std::string prefix = "parameters.";
  const auto none = [&](const char* what) {
    throw Error(StatusCode::invalid_input,
                fmt::format("'{}' {} in the text of the model; a parameter is a number that stands there", path, what));
  };
  if (path.rfind(prefix, 0) == 0) {
    for (const std::string& text : overrides) {
      Assignment a = parse_assignment(text);
      if (!made_by_repetition(root, a.path)) set_value(root, a.path, std::move(a.value));
    }
    const Scope scope = read_parameters(root);
    const auto it = scope.find(path.substr(prefix.size()));
    if (it == scope.end()) none("is not");
    return it->second;
  }
  expand(root, overrides);
  const Value* at = &root;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('.', begin), path.size());
    const std::string key = path.substr(begin, end - begin);
    if (at->type == Value::Type::array) {
      const bool digits = !key.empty() && key.size() < 10 && key.find_first_not_of("0123456789") == std::string::npos;
      const std::size_t item = digits ? std::stoul(key) : at->items.size();
      if (item >= at->items.size()) none("is not");
      at = &at->items[item];
    } else {
      at = at->is_table() ? at->find(key) : nullptr;
      if (at == nullptr) none("is not");
    }
    begin = end + 1;
  }
  if (at->type == Value::Type::text) {
    if (at->scope == nullptr) none("is no number");
    return evaluate(at->text, *at->scope, at->place);
  }
  if (at->type != Value::Type::real && at->type != Value::Type::integer) none("is no number");
  return at->real;
}

}  // namespace espalier::dynamics::model
