/// \file
/// Units of measurement: what a model's numbers are in, and values that are written with a unit.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace espalier::dynamics::model {

/// Exponents of the base quantities. Angles count: an angular speed is no frequency.
struct Dimension {
  double mass = 0, length = 0, time = 0, angle = 0;
  bool operator==(const Dimension&) const = default;
};

/// From words as those of SimulationQuantity::dimension: "force/length^2", "mass*length^2/time", "energy", "1".
/// @throws std::invalid_argument for other words
[[nodiscard]] Dimension parse_dimension(std::string_view words);
/// The other way round: "force/length^2".
[[nodiscard]] std::string dimension_words(const Dimension& dimension);

/// A unit: mantissa 10^power of the unit of SI. Both apart, so that metric prefixes are exact.
struct PhysicalUnit {
  double mantissa = 1;
  int power = 0;
  Dimension dimension;
};

/// "N/mm^2", "kg m2", "rpm", "1/s". @throws std::invalid_argument that says which part is no unit
[[nodiscard]] PhysicalUnit parse_unit(std::string_view text);

/// A text that is a number and a unit, "0.54 kg", or a list of numbers and a unit, "[3, 0, 0] mm".
struct WrittenValue {
  std::string_view number;  ///< or the list with its brackets
  std::string_view unit;
};
/// Nothing where the text is something else: a name, an expression.
[[nodiscard]] std::optional<WrittenValue> written_value(std::string_view text);

/// Consistent units: one of length, one of mass and one of time, all others follow.
class UnitSystem {
 public:
  /// @param name "SI" or three units in any order: "mm-t-s", "mm-kg-ms", "cm-g-s", "in-slinch-s"
  /// @throws std::invalid_argument that says what is wrong
  explicit UnitSystem(std::string name);
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] double from(double value, const PhysicalUnit& unit) const;
  /// The system's own unit of a dimension: "MPa" of "force/length^2" in "mm-t-s". Empty for "".
  [[nodiscard]] std::string unit_of(std::string_view dimension_words) const;

 private:
  /// The unit of a dimension in SI.
  [[nodiscard]] PhysicalUnit own(const Dimension& dimension) const;
  std::string name_;
  std::string names_[3];
  PhysicalUnit length_, mass_, time_;
};

/// A default of ours, a number of SI, in the units of a model. @param units  a system's name; "": none is stated, SI's
[[nodiscard]] double in_units(const std::string& units, double value, std::string_view unit);

}  // namespace espalier::dynamics::model
