#include "dynamics/model/read/value.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <numeric>

namespace espalier::dynamics::model {

std::string Place::text() const {
  std::string result = file;
  if (line > 0) result += fmt::format(":{}", line);
  if (!path.empty()) result += (result.empty() ? "" : ": ") + path;
  return result;
}

void fail(const Place& place, const std::string& message) {
  const std::string where = place.text();
  throw Error(StatusCode::invalid_input, where.empty() ? message : where + ": " + message);
}

const Value* Value::find(std::string_view key) const {
  for (const KeyValue& entry : entries)
    if (entry.first == key) return &entry.second;
  return nullptr;
}

Value* Value::find(std::string_view key) { return const_cast<Value*>(std::as_const(*this).find(key)); }

std::string excerpt(std::string_view text) {
  constexpr std::size_t kShown = 60;
  return text.size() <= kShown ? std::string(text) : std::string(text.substr(0, kShown)) + "...";
}

std::string_view name_of(Value::Type type) {
  switch (type) {
    case Value::Type::boolean:
      return "true or false";
    case Value::Type::integer:
      return "a whole number";
    case Value::Type::real:
      return "a number";
    case Value::Type::text:
      return "a text";
    case Value::Type::array:
      return "a list";
    case Value::Type::table:
      return "a table";
  }
  return "something";
}

namespace {

/// Levenshtein distance.
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t change = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({change, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

std::string nearest_name(std::string_view wrong, const std::vector<std::string>& names) {
  std::string best;
  if (wrong.size() > 100) return best;  // nobody means a name by that
  std::size_t least = std::max<std::size_t>(2, wrong.size() / 3) + 1;
  for (const std::string& name : names) {
    const std::size_t d = distance(wrong, name);
    if (d < least) {
      least = d;
      best = name;
    }
  }
  return best;
}

std::string suggestion(std::string_view wrong, const std::vector<std::string>& names) {
  if (const std::string near = nearest_name(wrong, names); !near.empty())
    return fmt::format("; did you mean '{}'?", near);
  if (names.empty()) return "; there are none";
  constexpr std::size_t kMost = 24;
  std::string list;
  for (std::size_t k = 0; k < std::min(kMost, names.size()); ++k) list += (k == 0 ? "" : ", ") + names[k];
  return fmt::format("; known are {}{}", list, names.size() > kMost ? ", ..." : "");
}

Assignment parse_assignment(const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  Assignment result{assignment.substr(0, equals), {}};
  const std::string& path = result.path;
  const Place place{"--set", 0, path};
  if (equals == std::string::npos || path.empty())
    fail({"--set", 0, excerpt(assignment)}, "needs PATH=VALUE, for instance parameters.size=2");
  if (path.size() > kLongestKey || static_cast<std::size_t>(std::count(path.begin(), path.end(), '.')) >= kMostKeyParts)
    fail({"--set", 0, excerpt(path)},
         fmt::format("the path is longer than {} characters or {} parts", kLongestKey, kMostKeyParts));
  const std::string text = assignment.substr(equals + 1);
  try {
    result.value = std::move(parse_toml("x = " + text, "--set").entries.at(0).second);
  } catch (const Error&) {  // not TOML: a text without quotes
    result.value.type = Value::Type::text;
    result.value.text = text;
  }
  result.value.place = place;
  return result;
}

namespace {

/// Item of a list by its number from 0.
Value& item_of(Value& list, const std::string& key, const Place& place) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), index);
  if (error != std::errc() || end != key.data() + key.size() || index >= list.items.size())
    fail(place, fmt::format("'{}' is a list of {}; its items are numbered from 0, not '{}'", list.place.path,
                            list.items.size(), key));
  return list.items[index];
}

void give_scope(Value& value, const std::shared_ptr<const Scope>& scope) {
  value.scope = scope;
  for (Value& item : value.items) give_scope(item, scope);
  for (KeyValue& entry : value.entries) give_scope(entry.second, scope);
}

}  // namespace

void set_value(Value& root, const std::string& path, Value value) {
  const Place place = value.place;
  Value* at = &root;
  for (std::size_t from = 0; from != std::string::npos;) {
    const std::size_t dot = path.find('.', from);
    const std::string key = path.substr(from, dot == std::string::npos ? dot : dot - from);
    if (key.empty()) fail(place, "the path has an empty key");
    Value* next = nullptr;
    if (at->type == Value::Type::array) {
      next = &item_of(*at, key, place);
    } else if (!at->is_table()) {
      fail(place, fmt::format("'{}' is {}, not a table", path.substr(0, from - 1), name_of(at->type)));
    } else if (next = at->find(key); next == nullptr) {
      at->entries.emplace_back(key, Value{});
      next = &at->entries.back().second;
      next->place = {"--set", 0, path.substr(0, dot)};
      next->scope = at->scope;
    }
    at = next;
    from = dot == std::string::npos ? dot : dot + 1;
  }
  give_scope(value, at->scope);
  *at = std::move(value);
}

}  // namespace espalier::dynamics::model
