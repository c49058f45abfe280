/// \file
/// What the numbers of a model's text measure: one row for the keys of a table that have a dimension in common.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {

struct KeyRow {
  /// Path of the table: "bodies.*.mesh", where * is any name, and parts may be alternatives, "joints|forces.*.a|b".
  std::string_view tables;
  /// What the table, or one around it, must say: "type=spring|axial-spring"; empty: nothing.
  std::string_view where;
  std::string_view keys;  ///< separated by blanks; "*": all
  /// In words (unit_system.hpp), alternatives separated by '|'; "1": a plain number; "any": whatever is written;
  /// "degree": an angle that is counted in degrees; "^e": with the `exponent` of a contact.
  std::string_view dimension;
};
[[nodiscard]] std::span<const KeyRow> key_rows();

/// Where a value stands: the tables around it, from the model on, and their keys.
struct KeyPath {
  std::vector<const Value*> tables;  ///< one more than keys
  std::vector<std::string> keys;
};
/// Dimensions, in words, that the numbers under a key of the innermost table may have; empty: it holds no numbers.
[[nodiscard]] std::vector<std::string> dimensions_of(const KeyPath& path, const std::string& key);

}  // namespace espalier::dynamics::model
