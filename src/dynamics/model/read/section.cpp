#include "dynamics/model/read/section.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/model/check/part_keys.hpp"
#include "dynamics/model/read/expand.hpp"
#include "dynamics/model/units/unit_system.hpp"

namespace espalier::dynamics::model {
namespace {

const Scope& scope_of(const Value& value) {
  static const Scope none;
  return value.scope ? *value.scope : none;
}

[[noreturn]] void wrong_type(const Value& value, std::string_view wanted) {
  fail(value.place, fmt::format("must be {}, not {}", wanted, name_of(value.type)));
}

}  // namespace

Section::Section(const Value& table) : table_(&table) {
  const std::string& path = table.place.path;
  if (!table.is_table())
    wrong_type(table, path.find('.') == std::string::npos && !path.empty() ? fmt::format("a section, [{}]", path)
                                                                           : "a table, { key = value }");
}

const Place& Section::place(std::string_view key) const {
  const Value* value = table_->find(key);
  return value == nullptr ? table_->place : value->place;
}

const Value* Section::get(const std::string& key) {
  known_.insert(key);
  return table_->find(key);
}

const Value& Section::need(const std::string& key) {
  const Value* value = get(key);
  if (value != nullptr) return *value;
  // A misspelt key explains a missing one; keys of two letters or fewer are all near to each other.
  for (const auto& [name, other] : table_->entries)
    if (std::min(name.size(), key.size()) > 2 && !known_.contains(name) && !nearest_name(name, {key}).empty())
      fail(other.place, fmt::format("unknown key; did you mean '{}'?", key));
  fail(table_->place, fmt::format("needs '{}'", key));
}

double Section::to_number(const Value& value) {
  double number = value.real;
  if (value.type == Value::Type::text) {
    try {
      number = Expression(value.text, scope_of(value), false).value();
    } catch (const Error& error) {
      if (written_value(value.text))
        fail(value.place, std::string("must be a plain number here, without a unit; ") + error.what());
      fail(value.place, std::string("must be a number; ") + error.what());
    }
  } else if (value.type != Value::Type::integer && value.type != Value::Type::real) {
    wrong_type(value, "a number");
  }
  if (!std::isfinite(number)) fail(value.place, fmt::format("must be a finite number, not {}", number));
  return number;
}

double Section::number(const std::string& key) { return to_number(need(key)); }

double Section::number(const std::string& key, double otherwise) {
  const Value* value = get(key);
  return value == nullptr ? otherwise : to_number(*value);
}

double Section::positive(const std::string& key) {
  const double result = number(key);
  if (!(result > 0)) fail(place(key), fmt::format("must be greater than 0, not {}", result));
  return result;
}

double Section::positive(const std::string& key, double otherwise) {
  return get(key) == nullptr ? otherwise : positive(key);
}

int Section::integer(const std::string& key, int least, int otherwise, int most) {
  const Value* value = get(key);
  if (value == nullptr) return otherwise;
  const double result = to_number(*value);
  if (result != std::floor(result) || result < least || result > most)
    fail(value->place, fmt::format("must be a whole number {}, not {}",
                                   most == kMostInteger ? fmt::format("of at least {}", least)
                                                        : fmt::format("from {} to {}", least, most),
                                   number_text(result)));
  return static_cast<int>(result);
}

bool Section::flag(const std::string& key, bool otherwise) {
  const Value* value = get(key);
  if (value == nullptr) return otherwise;
  if (value->type != Value::Type::boolean) wrong_type(*value, "true or false");
  return value->boolean;
}

std::string Section::text(const std::string& key) {
  const Value& value = need(key);
  if (value.type != Value::Type::text) wrong_type(value, "a text");
  return value.text;
}

std::string Section::text(const std::string& key, const std::string& otherwise) {
  return get(key) == nullptr ? otherwise : text(key);
}

int Section::choice(const std::string& key, const std::vector<std::string>& names, int otherwise) {
  if (get(key) == nullptr && otherwise >= 0) return otherwise;
  const std::string word = text(key);
  const auto it = std::find(names.begin(), names.end(), word);
  if (it == names.end()) {
    // Few choices are better listed than guessed.
    std::string list;
    for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
    const std::string near = nearest_name(word, names);
    fail(place(key), fmt::format("unknown {} '{}'{}; known are {}", key, word,
                                 near.empty() ? "" : fmt::format("; did you mean '{}'?", near), list));
  }
  return static_cast<int>(it - names.begin());
}

std::vector<std::string> Section::texts(const std::string& key) {
  std::vector<std::string> result;
  const Value* list = get(key);
  if (list == nullptr) return result;
  if (list->type == Value::Type::text) return {list->text};
  if (list->type != Value::Type::array) wrong_type(*list, "a list of texts");
  for (const Value& item : list->items) {
    if (item.type != Value::Type::text) wrong_type(item, "a text");
    result.push_back(item.text);
  }
  return result;
}

std::vector<double> Section::numbers(const std::string& key) {
  const Value& list = need(key);
  if (list.type != Value::Type::array) wrong_type(list, "a list of numbers");
  std::vector<double> result;
  for (const Value& item : list.items) result.push_back(to_number(item));
  return result;
}

Vec3 Section::to_vector(const Value& value) {
  if (value.type != Value::Type::array || value.items.size() != 3)
    fail(value.place, fmt::format("must be a list of three numbers, not {}",
                                  value.type == Value::Type::array ? fmt::format("of {}", value.items.size())
                                                                   : std::string(name_of(value.type))));
  return {to_number(value.items[0]), to_number(value.items[1]), to_number(value.items[2])};
}

Vec3 Section::vector(const std::string& key) { return to_vector(need(key)); }

Vec3 Section::vector(const std::string& key, const Vec3& otherwise) {
  const Value* value = get(key);
  return value == nullptr ? otherwise : to_vector(*value);
}

std::vector<Vec3> Section::vectors(const std::string& key) {
  const Value& list = need(key);
  if (list.type != Value::Type::array) wrong_type(list, "a list of points [x, y, z]");
  std::vector<Vec3> result;
  for (const Value& item : list.items) result.push_back(to_vector(item));
  return result;
}

Mat3 Section::matrix(const std::string& key) {
  const Value& value = need(key);
  if (value.type == Value::Type::array && value.items.size() == 3 && value.items[0].type == Value::Type::array) {
    Mat3 result;
    for (int i = 0; i < 3; ++i) result.row(i) = to_vector(value.items[at(i)]).transpose();
    if ((result - result.transpose()).cwiseAbs().maxCoeff() > 1e-12 * result.cwiseAbs().maxCoeff())
      fail(value.place, "must be symmetric");
    return result;
  }
  return to_vector(value).asDiagonal();
}

Mat3 Section::rotation(const std::string& key) {
  const Value* value = get(key);
  if (value == nullptr) return Mat3::Identity();
  if (value->type == Value::Type::array) return rotation_exp(to_vector(*value));
  Section table(*value);
  Mat3 result;
  if (table.has("quaternion")) {
    const std::vector<double> q = table.numbers("quaternion");
    if (q.size() != 4) fail(table.place("quaternion"), "must be four numbers [w, x, y, z]");
    const Quat quaternion(q[0], q[1], q[2], q[3]);
    if (!(quaternion.norm() > 0)) fail(table.place("quaternion"), "must not be zero");
    result = rotation_matrix(quaternion.normalized());
  } else {
    const Vec3 axis = table.vector("axis");
    if (!(axis.norm() > 0)) fail(table.place("axis"), "must not be zero");
    result = rotation_exp(axis.normalized() * table.number("angle"));
  }
  table.finish();
  return result;
}

namespace {

Expression parsed(const Value& value, const std::string& text, Expression::Names names) {
  try {
    return {text, scope_of(value), names};
  } catch (const Error& error) {
    fail(value.place, error.what());
  }
}

}  // namespace

Expression Section::function(const std::string& key) {
  const Value& value = need(key);
  if (value.type == Value::Type::text) return parsed(value, value.text, Expression::Names::time);
  return parsed(value, fmt::format("{}", to_number(value)), Expression::Names::time);
}

Expression Section::state_function(const std::string& key) { return state_function(need(key)); }

Expression Section::state_function(const Value& value) {
  if (value.type == Value::Type::text) return parsed(value, value.text, Expression::Names::state);
  return parsed(value, fmt::format("{}", to_number(value)), Expression::Names::state);
}

const Value* Section::value(const std::string& key) { return get(key); }

std::optional<Section> Section::table(const std::string& key) {
  const Value* value = get(key);
  if (value == nullptr) return std::nullopt;
  return Section(*value);
}

void Section::named(const std::string& key, const std::function<void(const std::string&, const Value&)>& each) {
  const Value* group = get(key);
  if (group == nullptr) return;
  if (!group->is_table()) fail(group->place, fmt::format("must hold named tables, for instance [{}.name]", key));
  for (const auto& [name, value] : group->entries) {
    const bool plain = !name.empty() && std::all_of(name.begin(), name.end(), [](unsigned char c) {
      return std::isalnum(c) != 0 || c == '-' || c == '_';
    });
    if (!plain) fail(value.place, "names are made of letters, digits, - and _");
    if (!value.is_table()) fail(value.place, fmt::format("must be a table, for instance [{}.{}]", key, name));
    try {
      each(name, value);
    } catch (const Error& error) {
      if (error.status().code == StatusCode::invalid_input) refuse_unknown_keys(key, value, error);
      throw;
    }
  }
}

void Section::finish() const {
  for (const auto& [name, value] : table_->entries)
    if (!known_.contains(name))
      fail(value.place, fmt::format("unknown key{}", suggestion(name, {known_.begin(), known_.end()})));
}

}  // namespace espalier::dynamics::model
