/// \file
/// A model text as a tree of values that know where they stand. The tree is what is left of TOML after reading: nothing
/// above this layer sees the TOML library.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::dynamics::model {

/// Where something stands in a model text, for messages.
struct Place {
  std::string file;  ///< file name, or "--set" for a value given on the command line
  int line = 0;      ///< from 1; 0: not in a file
  std::string path;  ///< dotted path of keys, for instance bodies.rod.mass

  /// "file:line: path" with the parts that are known.
  [[nodiscard]] std::string text() const;
  bool operator==(const Place&) const = default;
};

/// @throws Error(invalid_input) "file:line: path: message"
[[noreturn]] void fail(const Place& place, const std::string& message);

/// Names and their numbers, for expressions.
using Scope = std::map<std::string, double>;

struct KeyValue;

/// A value: a scalar, an array or a table. Tables keep the order of the text.
struct Value {
  enum class Type { boolean, integer, real, text, array, table };

  Type type = Type::table;
  bool boolean = false;
  std::int64_t integer = 0;
  double real = 0;
  std::string text;
  std::vector<Value> items;
  std::vector<KeyValue> entries;
  Place place;
  std::shared_ptr<const Scope> scope;  ///< names that expressions in this text may use; null until expand()

  [[nodiscard]] bool is_table() const { return type == Type::table; }
  [[nodiscard]] const Value* find(std::string_view key) const;
  [[nodiscard]] Value* find(std::string_view key);
};

/// A key and its value.
struct KeyValue {
  KeyValue(std::string key, Value value) : first(std::move(key)), second(std::move(value)) {}
  std::string first;
  Value second;
};

/// "a number", "a text", ... for messages.
[[nodiscard]] std::string_view name_of(Value::Type type);

/// A text for messages: of a long one, the beginning.
[[nodiscard]] std::string excerpt(std::string_view text);

/// The longest key, and the most parts of one with dots ("a.b.c" has three): models are not nested deeper.
inline constexpr std::size_t kLongestKey = 1000, kMostKeyParts = 64;

/// The one of `names` that looks most like `wrong`, or "" where none is near (edit distance above a third).
[[nodiscard]] std::string nearest_name(std::string_view wrong, const std::vector<std::string>& names);
/// "; did you mean 'x'?" or "; known are a, b, c".
[[nodiscard]] std::string suggestion(std::string_view wrong, const std::vector<std::string>& names);

/// Parses TOML. @param file its name for messages @throws Error(invalid_input) "file:line: what"
[[nodiscard]] Value parse_toml(std::string_view text, const std::string& file);

/// A value for a path of keys: "bodies.rod.mass=2" (a TOML value; what is none is taken as text).
struct Assignment {
  std::string path;
  Value value;
};
/// @throws Error(invalid_input) without a path or a value
[[nodiscard]] Assignment parse_assignment(const std::string& assignment);

/// Sets one value by its path; items of lists are numbered from 0: "repeat.0.to". Missing tables on the way are made.
/// @throws Error(invalid_input) where the path runs through something that is neither table nor list
void set_value(Value& root, const std::string& path, Value value);

}  // namespace espalier::dynamics::model
