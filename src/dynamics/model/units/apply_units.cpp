#include "dynamics/model/units/apply_units.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <numbers>
#include <stdexcept>

#include "base/strtod.hpp"
#include "dynamics/model/units/key_dimensions.hpp"

namespace espalier::dynamics::model {
namespace {

/// Whether a unit may stand where `wanted` is asked for. Per radian goes without saying: N m is a torsional stiffness.
bool goes_for(const Dimension& unit, const Dimension& wanted) {
  Dimension other = wanted;
  if (unit == other) return true;
  if (other.angle < 0) other.angle = 0;
  return unit == other;
}

bool is_unit(std::string_view text) {
  try {
    (void)parse_unit(text);
  } catch (const std::invalid_argument&) {
    return false;
  }
  return true;
}

class UnitApplier {
 public:
  explicit UnitApplier(std::optional<UnitSystem> units) : units_(std::move(units)) {}

  void table(Value& value) {
    path_.tables.push_back(&value);
    for (auto& [key, entry] : value.entries) under_key(key, entry);
    path_.tables.pop_back();
  }

  /// A text is replaced where it is a value with a unit.
  void text(Value& value, const std::vector<std::string>& dimensions) const {
    const std::optional<WrittenValue> written = written_value(value.text);
    if (!written) return;
    if (!units_ && !is_unit(written->unit)) return;  // of an expression that is wrong
    if (!units_)
      fail(
          value.place,
          fmt::format("\"{}\" has a unit, and the model does not say what its numbers are in: write units = \"SI\" (m, "
                      "kg, s) or \"mm-t-s\" (N, MPa) at its top",
                      excerpt(value.text)));
    const PhysicalUnit unit = unit_in(value, *written, dimensions);
    if (written->number.front() == '[') {
      list(value, std::string(written->number), unit, dimensions);
    } else {
      value.real = converted(parsed_number(value, std::string(written->number)), unit, dimensions);
      value.type = Value::Type::real;
      value.text.clear();
    }
  }

 private:
  void under_key(const std::string& key, Value& value) {
    if (value.is_table()) {
      path_.keys.push_back(key);
      table(value);
      path_.keys.pop_back();
    } else if (value.type == Value::Type::array) {
      for (Value& item : value.items) under_key(key, item);
    } else if (value.type == Value::Type::text && written_value(value.text)) {
      const std::vector<std::string> dimensions = dimensions_of(path_, key);
      if (!dimensions.empty()) text(value, dimensions);
    }
  }

  [[nodiscard]] PhysicalUnit unit_in(const Value& value, const WrittenValue& written,
                                     const std::vector<std::string>& dimensions) const {
    PhysicalUnit unit;
    try {
      unit = parse_unit(written.unit);
    } catch (const std::invalid_argument& error) {
      fail(value.place, fmt::format("\"{}\": {}", excerpt(value.text), error.what()));
    }
    for (const std::string& words : dimensions)
      if (words == "any" || goes_for(unit.dimension, parse_dimension(words == "degree" ? "angle" : words))) return unit;
    const std::string& wanted = dimensions.front();
    const std::string example = units_->unit_of(wanted == "degree" ? "angle" : wanted);
    const std::string is = dimension_words(unit.dimension);
    fail(value.place,
         wanted == "1"
             ? fmt::format("\"{}\" has the dimension {}, and a plain number is expected", excerpt(value.text), is)
             : fmt::format("\"{}\" has the dimension {}, and {} is expected, for instance in {}", excerpt(value.text),
                           is, wanted == "degree" ? "angle" : wanted, example));
  }

  [[nodiscard]] double converted(double number, const PhysicalUnit& unit,
                                 const std::vector<std::string>& dimensions) const {
    const double own = units_->from(number, unit);
    return dimensions.front() == "degree" && unit.dimension.angle == 1 ? own * 180 / std::numbers::pi : own;
  }

  static double parsed_number(const Value& value, const std::string& number) {
    errno = 0;
    const double read = base::strtod(number.c_str());
    if (errno == ERANGE) fail(value.place, fmt::format("\"{}\" is beyond the range of numbers", excerpt(value.text)));
    return read;
  }

  void list(Value& value, const std::string& number, const PhysicalUnit& unit,
            const std::vector<std::string>& dimensions) const {
    Value items;
    try {
      items = std::move(parse_toml("x = " + number, "").entries.at(0).second);
    } catch (const Error&) {
      fail(value.place,
           fmt::format("\"{}\" is no list of numbers with a unit, like \"[3, 0, 0] mm\"", excerpt(value.text)));
    }
    convert_items(items, value, value.place.path, unit, dimensions);
    value.items = std::move(items.items);
    value.type = Value::Type::array;
    value.text.clear();
  }

  void convert_items(Value& item, const Value& whole, const std::string& path, const PhysicalUnit& unit,
                     const std::vector<std::string>& dimensions) const {
    item.place = {whole.place.file, whole.place.line, path};
    item.scope = whole.scope;
    if (item.type == Value::Type::array) {
      for (std::size_t k = 0; k < item.items.size(); ++k)
        convert_items(item.items[k], whole, fmt::format("{}[{}]", path, k), unit, dimensions);
    } else if (item.type == Value::Type::integer || item.type == Value::Type::real) {
      item.real = converted(item.real, unit, dimensions);
      item.type = Value::Type::real;
    } else {
      fail(item.place, fmt::format("must be a number, not {}: the unit behind the list is that of all its numbers",
                                   name_of(item.type)));
    }
  }

  std::optional<UnitSystem> units_;
  KeyPath path_;
};

}  // namespace

std::optional<UnitSystem> stated_units(const Value& root) {
  const Value* value = root.find("units");
  if (value == nullptr) return std::nullopt;
  if (value->type != Value::Type::text)
    fail(value->place, fmt::format("must be a text like \"SI\" or \"mm-t-s\", not {}", name_of(value->type)));
  try {
    return UnitSystem(value->text);
  } catch (const std::invalid_argument& error) {
    fail(value->place, error.what());
  }
}

std::optional<double> parameter_with_unit(const Value& value, const std::optional<UnitSystem>& units) {
  if (value.type != Value::Type::text || !written_value(value.text)) return std::nullopt;
  Value copy = value;
  UnitApplier(units).text(copy, {"any"});
  if (copy.type != Value::Type::real) fail(value.place, "must be one number, not a list");
  return copy.real;
}

void apply_units(Value& root) { UnitApplier(stated_units(root)).table(root); }

}  // namespace espalier::dynamics::model
