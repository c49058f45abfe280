/// \file
/// Checked access to a table of a model text: every key is asked for by its type, and what nobody asked for is an
/// error.
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/named.hpp"
#include "dynamics/bodies/rotation.hpp"
#include "dynamics/model/read/expression.hpp"
#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {

/// A view of a table; the table must outlive it. All functions throw Error(invalid_input) with file, line and path.
class Section {
 public:
  explicit Section(const Value& table);
  static constexpr int kMostInteger = 2'000'000'000;

  [[nodiscard]] const Place& place() const { return table_->place; }
  /// Place of a key's value; of the table where the key is missing.
  [[nodiscard]] const Place& place(std::string_view key) const;
  [[nodiscard]] bool has(std::string_view key) const { return table_->find(key) != nullptr; }

  /// Numbers may be written as expressions of parameters ("2*length"); they must be finite.
  [[nodiscard]] double number(const std::string& key);
  [[nodiscard]] double number(const std::string& key, double otherwise);
  /// > 0
  [[nodiscard]] double positive(const std::string& key);
  [[nodiscard]] double positive(const std::string& key, double otherwise);
  /// @param most  to be given where the number sets how much memory is taken
  [[nodiscard]] int integer(const std::string& key, int least, int otherwise, int most = kMostInteger);
  [[nodiscard]] bool flag(const std::string& key, bool otherwise);
  [[nodiscard]] std::string text(const std::string& key);
  [[nodiscard]] std::string text(const std::string& key, const std::string& otherwise);
  /// One of `names`; its position. Without the key: `otherwise`, or an error where that is -1.
  [[nodiscard]] int choice(const std::string& key, const std::vector<std::string>& names, int otherwise = -1);
  /// The row of a table that the text names; rows have a `name`. Without the key: the first row, if `first`, or an
  /// error.
  template <class Row, std::size_t n>
  [[nodiscard]] const Row& row(const std::string& key, const Row (&rows)[n], bool first = false) {
    std::vector<std::string> names;
    for (const Row& r : rows) names.emplace_back(r.name);
    return rows[choice(key, names, first ? 0 : -1)];
  }
  /// The same of rows that stand elsewhere.
  template <class Row, std::size_t n>
  [[nodiscard]] const Row& row(const std::string& key, const Row* const (&rows)[n]) {
    std::vector<std::string> names;
    for (const Row* r : rows) names.emplace_back(r->name);
    return *rows[choice(key, names)];
  }
  /// The value of the row that the text names.
  template <class T, std::size_t n>
  [[nodiscard]] T one_of(const std::string& key, const base::Named<T> (&rows)[n]) {
    return row(key, rows).value;
  }
  template <class T, std::size_t n>
  [[nodiscard]] T one_of(const std::string& key, const base::Named<T> (&rows)[n], std::type_identity_t<T> otherwise) {
    return get(key) == nullptr ? otherwise : row(key, rows).value;
  }
  [[nodiscard]] std::vector<std::string> texts(const std::string& key);
  [[nodiscard]] std::vector<double> numbers(const std::string& key);
  [[nodiscard]] Vec3 vector(const std::string& key);
  [[nodiscard]] Vec3 vector(const std::string& key, const Vec3& otherwise);
  /// A list of lists of three numbers.
  [[nodiscard]] std::vector<Vec3> vectors(const std::string& key);
  /// A list of three (diagonal) or of three lists of three (symmetric).
  [[nodiscard]] Mat3 matrix(const std::string& key);
  /// { axis, angle } in radians, { quaternion = [w, x, y, z] } or a rotation vector; identity without the key.
  [[nodiscard]] Mat3 rotation(const std::string& key);
  /// A number or an expression of t.
  [[nodiscard]] Expression function(const std::string& key);
  /// A number or an expression of t and quantities.
  [[nodiscard]] Expression state_function(const std::string& key);
  [[nodiscard]] static Expression state_function(const Value& value);
  /// A value that is a number, or an expression of parameters.
  [[nodiscard]] static double plain_number(const Value& value) { return to_number(value); }
  /// The table under a key, or nothing.
  [[nodiscard]] const Value* value(const std::string& key);
  [[nodiscard]] std::optional<Section> table(const std::string& key);
  /// Calls `each` with every named table under `key`. Names are letters, digits, - and _.
  void named(const std::string& key, const std::function<void(const std::string&, const Value&)>& each);

  /// @throws for keys that nobody asked for, with the nearest known one
  void finish() const;

 private:
  const Value* get(const std::string& key);
  const Value& need(const std::string& key);
  [[nodiscard]] static double to_number(const Value& value);
  [[nodiscard]] static Vec3 to_vector(const Value& value);

  const Value* table_;
  std::set<std::string> known_;
};

}  // namespace espalier::dynamics::model
