#include "dynamics/model/units/unit_system.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "base/strtod.hpp"
#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr Dimension kNone{}, kMass{1, 0, 0, 0}, kLength{0, 1, 0, 0}, kTime{0, 0, 1, 0}, kAngle{0, 0, 0, 1},
    kForce{1, 1, -2, 0}, kPressure{1, -1, -2, 0}, kEnergy{1, 2, -2, 0}, kPower{1, 2, -3, 0}, kFrequency{0, 0, -1, 0},
    kAngularSpeed{0, 0, -1, 1}, kAcceleration{0, 1, -2, 0};

struct NamedPhysicalUnit {
  std::string_view name;
  PhysicalUnit unit;
};

// The pound is 0.45359237 kg, standard gravity 9.80665 m/s^2, the inch 0.0254 m; the others follow.
constexpr double kPound = 0.45359237, kGravity = 9.80665, kInch = 0.0254, kPoundForce = kPound * kGravity;

constexpr std::array kUnits = {
    NamedPhysicalUnit{"m", {1, 0, kLength}},
    NamedPhysicalUnit{"km", {1, 3, kLength}},
    NamedPhysicalUnit{"dm", {1, -1, kLength}},
    NamedPhysicalUnit{"cm", {1, -2, kLength}},
    NamedPhysicalUnit{"mm", {1, -3, kLength}},
    NamedPhysicalUnit{"um", {1, -6, kLength}},
    NamedPhysicalUnit{"\u00b5m", {1, -6, kLength}},
    NamedPhysicalUnit{"\u03bcm", {1, -6, kLength}},
    NamedPhysicalUnit{"nm", {1, -9, kLength}},
    NamedPhysicalUnit{"in", {254, -4, kLength}},
    NamedPhysicalUnit{"ft", {3048, -4, kLength}},
    NamedPhysicalUnit{"kg", {1, 0, kMass}},
    NamedPhysicalUnit{"g", {1, -3, kMass}},
    NamedPhysicalUnit{"mg", {1, -6, kMass}},
    NamedPhysicalUnit{"t", {1, 3, kMass}},
    NamedPhysicalUnit{"lb", {kPound, 0, kMass}},
    NamedPhysicalUnit{"slug", {kPoundForce / (12 * kInch), 0, kMass}},
    NamedPhysicalUnit{"slinch", {kPoundForce / kInch, 0, kMass}},
    NamedPhysicalUnit{"s", {1, 0, kTime}},
    NamedPhysicalUnit{"ms", {1, -3, kTime}},
    NamedPhysicalUnit{"us", {1, -6, kTime}},
    NamedPhysicalUnit{"\u00b5s", {1, -6, kTime}},
    NamedPhysicalUnit{"\u03bcs", {1, -6, kTime}},
    NamedPhysicalUnit{"min", {60, 0, kTime}},
    NamedPhysicalUnit{"h", {3600, 0, kTime}},
    NamedPhysicalUnit{"rad", {1, 0, kAngle}},
    NamedPhysicalUnit{"mrad", {1, -3, kAngle}},
    NamedPhysicalUnit{"deg", {std::numbers::pi / 180, 0, kAngle}},
    NamedPhysicalUnit{"\u00b0", {std::numbers::pi / 180, 0, kAngle}},
    NamedPhysicalUnit{"rev", {2 * std::numbers::pi, 0, kAngle}},
    NamedPhysicalUnit{"rpm", {std::numbers::pi / 30, 0, kAngularSpeed}},
    NamedPhysicalUnit{"Hz", {1, 0, kFrequency}},
    NamedPhysicalUnit{"kHz", {1, 3, kFrequency}},
    NamedPhysicalUnit{"N", {1, 0, kForce}},
    NamedPhysicalUnit{"mN", {1, -3, kForce}},
    NamedPhysicalUnit{"kN", {1, 3, kForce}},
    NamedPhysicalUnit{"MN", {1, 6, kForce}},
    NamedPhysicalUnit{"lbf", {kPoundForce, 0, kForce}},
    NamedPhysicalUnit{"kgf", {kGravity, 0, kForce}},
    NamedPhysicalUnit{"Pa", {1, 0, kPressure}},
    NamedPhysicalUnit{"kPa", {1, 3, kPressure}},
    NamedPhysicalUnit{"MPa", {1, 6, kPressure}},
    NamedPhysicalUnit{"GPa", {1, 9, kPressure}},
    NamedPhysicalUnit{"bar", {1, 5, kPressure}},
    NamedPhysicalUnit{"psi", {kPoundForce / (kInch * kInch), 0, kPressure}},
    NamedPhysicalUnit{"ksi", {kPoundForce / (kInch * kInch), 3, kPressure}},
    NamedPhysicalUnit{"J", {1, 0, kEnergy}},
    NamedPhysicalUnit{"mJ", {1, -3, kEnergy}},
    NamedPhysicalUnit{"kJ", {1, 3, kEnergy}},
    NamedPhysicalUnit{"MJ", {1, 6, kEnergy}},
    NamedPhysicalUnit{"W", {1, 0, kPower}},
    NamedPhysicalUnit{"mW", {1, -3, kPower}},
    NamedPhysicalUnit{"kW", {1, 3, kPower}},
    NamedPhysicalUnit{"MW", {1, 6, kPower}},
    NamedPhysicalUnit{"gn", {kGravity, 0, kAcceleration}},
    NamedPhysicalUnit{"%", {1, -2, kNone}},
};

constexpr std::pair<std::string_view, Dimension> kBaseWords[] = {
    {"mass", kMass}, {"length", kLength}, {"time", kTime}, {"angle", kAngle}, {"force", kForce}, {"energy", kEnergy}};

Dimension plus(const Dimension& a, const Dimension& b, double factor) {
  return {a.mass + factor * b.mass, a.length + factor * b.length, a.time + factor * b.time, a.angle + factor * b.angle};
}

/// One factor of a product: a name, or the number 1, with its exponent, negative behind a '/'.
struct UnitFactor {
  std::string_view name;
  double exponent = 1;
};

bool is_mark(char c) { return c == '*' || c == '/' || c == '^' || c == ' '; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Takes an exponent from the front: "^2", "^-1", "^1.5", "2", a superscript two or three; 1 where there is none.
double take_exponent(std::string_view& text) {
  constexpr std::pair<std::string_view, double> kRaised[] = {{"\u00b2", 2}, {"\u00b3", 3}};
  for (const auto& [sign, exponent] : kRaised)
    if (text.starts_with(sign)) {
      text.remove_prefix(sign.size());
      return exponent;
    }
  const bool caret = text.starts_with("^");
  if (caret) text.remove_prefix(1);
  std::size_t end = caret && text.starts_with("-") ? 1 : 0;
  while (end < text.size() && (is_digit(text[end]) || (caret && text[end] == '.'))) ++end;
  if (end == 0) {
    if (caret) throw std::invalid_argument("a number is missing behind '^'");
    return 1;
  }
  const double exponent = base::strtod(std::string(text.substr(0, end)).c_str());
  text.remove_prefix(end);
  return exponent;
}

/// "kg m^2/s" and "force*length/angle" alike.
std::vector<UnitFactor> product_of(std::string_view text) {
  std::vector<UnitFactor> parts;
  double sign = 1;
  bool marked = true;  // a factor has to follow
  while (!text.empty()) {
    if (text.front() == ' ') {
      text.remove_prefix(1);
      continue;
    }
    if (text.front() == '*' || text.front() == '/') {
      if (marked) throw std::invalid_argument(fmt::format("a unit is missing before '{}'", text.front()));
      sign = text.front() == '/' ? -1 : 1;
      marked = true;
      text.remove_prefix(1);
      continue;
    }
    std::size_t end = 0;
    if (text.front() == '1' && (text.size() == 1 || is_mark(text[1]))) {
      end = 1;
    } else {
      while (end < text.size() && !is_mark(text[end]) && !is_digit(text[end]) &&
             !text.substr(end).starts_with("\u00b2") && !text.substr(end).starts_with("\u00b3"))
        ++end;
    }
    if (end == 0) throw std::invalid_argument(fmt::format("'{}' is no unit", text));
    UnitFactor part{text.substr(0, end), sign};
    text.remove_prefix(end);
    part.exponent *= take_exponent(text);
    constexpr double kLargest = 20;
    if (!(std::abs(part.exponent) <= kLargest))
      throw std::invalid_argument(fmt::format("an exponent of {:g} makes no unit", part.exponent));
    parts.push_back(part);
    sign = 1;
    marked = false;
  }
  if (marked) throw std::invalid_argument("a unit is missing at the end");
  return parts;
}

PhysicalUnit unit_named(std::string_view name) {
  if (name == "1") return {};
  std::vector<std::string> names;
  for (const NamedPhysicalUnit& known : kUnits) {
    if (known.name == name) return known.unit;
    names.emplace_back(known.name);
  }
  const std::string near = nearest_name(name, names);
  throw std::invalid_argument(
      fmt::format("unknown unit '{}'{}", excerpt(name), near.empty() ? "" : fmt::format("; did you mean '{}'?", near)));
}

PhysicalUnit product(const std::vector<UnitFactor>& parts) {
  PhysicalUnit result;
  for (const UnitFactor& part : parts) {
    const PhysicalUnit unit = unit_named(part.name);
    const double power = unit.power * part.exponent;
    if (power == std::floor(power))
      result.power += static_cast<int>(power);
    else
      result.mantissa *= std::pow(10.0, power);
    if (unit.mantissa != 1)
      result.mantissa = part.exponent == 1    ? result.mantissa * unit.mantissa
                        : part.exponent == -1 ? result.mantissa / unit.mantissa
                                              : result.mantissa * std::pow(unit.mantissa, part.exponent);
    result.dimension = plus(result.dimension, unit.dimension, part.exponent);
  }
  return result;
}

std::string with_exponent(std::string_view name, double exponent) {
  return exponent == 1 ? std::string(name) : fmt::format("{}^{:g}", name, exponent);
}

/// "kg*m/s^2" of names with exponents; "1" of none.
std::string joined_product(const std::vector<UnitFactor>& parts) {
  std::string above, below;
  for (const UnitFactor& part : parts) {
    if (part.exponent == 0 || part.name == "1") continue;
    if (part.exponent > 0)
      above += (above.empty() ? "" : "*") + with_exponent(part.name, part.exponent);
    else
      below += "/" + with_exponent(part.name, -part.exponent);
  }
  return (above.empty() ? "1" : above) + below;
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

/// Length of the number that a text begins with.
std::size_t number_length(std::string_view text) {
  std::size_t at = text.starts_with("-") || text.starts_with("+") ? 1 : 0;
  const auto digits = [&] {
    const std::size_t from = at;
    while (at < text.size() && is_digit(text[at])) ++at;
    return at - from;
  };
  std::size_t count = digits();
  if (at < text.size() && text[at] == '.') {
    ++at;
    count += digits();
  }
  if (count == 0) return 0;
  const std::size_t end = at;
  if (at < text.size() && (text[at] == 'e' || text[at] == 'E')) {
    ++at;
    if (at < text.size() && (text[at] == '-' || text[at] == '+')) ++at;
    if (digits() > 0) return at;
  }
  return end;
}

}  // namespace

Dimension parse_dimension(std::string_view words) {
  Dimension result;
  for (const UnitFactor& part : product_of(words)) {
    if (part.name == "1") continue;
    bool found = false;
    for (const auto& [word, dimension] : kBaseWords)
      if (word == part.name) {
        result = plus(result, dimension, part.exponent);
        found = true;
      }
    if (!found) throw std::invalid_argument(fmt::format("'{}' is no dimension", part.name));
  }
  return result;
}

std::string dimension_words(const Dimension& d) {
  // With forces where there are any: who reads it thinks in newtons.
  static constexpr std::array<std::string_view, 14> kUsual = {
      "force",          "energy",         "force/length",  "force/length^2", "force*length/angle", "force*time/length",
      "force/length^3", "force*length^2", "mass*length^2", "mass/length^3",  "mass/length",        "length/time",
      "length/time^2",  "angle/time"};
  for (const std::string_view words : kUsual)
    if (parse_dimension(words) == d) return std::string(words);
  const std::string text =
      joined_product({{"mass", d.mass}, {"length", d.length}, {"time", d.time}, {"angle", d.angle}});
  return text == "1" ? "number" : text;
}

PhysicalUnit parse_unit(std::string_view text) { return product(product_of(trimmed(text))); }

std::optional<WrittenValue> written_value(std::string_view text) {
  text = trimmed(text);
  std::size_t end = 0;
  if (text.starts_with("[")) {
    const std::size_t close = text.rfind(']');
    if (close == std::string_view::npos) return std::nullopt;
    end = close + 1;
  } else {
    end = number_length(text);
  }
  const std::string_view unit = trimmed(text.substr(end));
  if (end == 0 || unit.empty()) return std::nullopt;
  const auto first = static_cast<unsigned char>(unit.front());
  const bool letter = (first >= 'a' && first <= 'z') || (first >= 'A' && first <= 'Z') || first >= 0x80;
  if (!letter && unit != "%" && !unit.starts_with("1/")) return std::nullopt;
  return WrittenValue{text.substr(0, end), unit};
}

UnitSystem::UnitSystem(std::string name) : name_(std::move(name)) {
  const std::string text = name_ == "SI" ? "m-kg-s" : name_;
  const auto refuse = [&](const std::string& why) {
    throw std::invalid_argument(
        fmt::format("'{}' is no system of units{}; take \"SI\", or the units of length, mass and time like \"mm-t-s\" "
                    "(forces in N, stresses in MPa), \"mm-kg-ms\" (kN, GPa), \"cm-g-s\", \"in-slinch-s\" (lbf, psi)",
                    excerpt(name_), why));
  };
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t to = std::min(text.find('-', from), text.size());
    const std::string part = text.substr(from, to - from);
    from = to + 1;
    PhysicalUnit unit;
    try {
      unit = unit_named(part);
    } catch (const std::invalid_argument& error) {
      refuse(std::string(": ") + error.what());
    }
    const std::size_t which = unit.dimension == kLength ? 0
                              : unit.dimension == kMass ? 1
                              : unit.dimension == kTime ? 2
                                                        : 3;
    if (which == 3) refuse(fmt::format(": '{}' is neither length nor mass nor time", part));
    if (!names_[which].empty()) refuse(fmt::format(": '{}' and '{}' are units of the same", names_[which], part));
    names_[which] = part;
    (which == 0 ? length_ : which == 1 ? mass_ : time_) = unit;
  }
  for (const std::string& given : names_)
    if (given.empty()) refuse("");
}

PhysicalUnit UnitSystem::own(const Dimension& d) const {
  return product({{names_[0], d.length}, {names_[1], d.mass}, {names_[2], d.time}, {"rad", d.angle}});
}

double UnitSystem::from(double value, const PhysicalUnit& unit) const {
  const PhysicalUnit base = own(unit.dimension);
  const double mantissa = unit.mantissa == base.mantissa ? 1 : unit.mantissa / base.mantissa;
  const int power = unit.power - base.power;
  const double scaled = value * mantissa;
  return power < 0 ? scaled / std::pow(10.0, -power) : scaled * std::pow(10.0, power);
}

std::string UnitSystem::unit_of(std::string_view words) const {
  if (words.empty() || words == "1") return std::string(words);
  const Dimension dimension = parse_dimension(words);
  constexpr double kSame = 1e-12;
  const auto name_of_own = [&](const Dimension& d) -> std::string {
    const PhysicalUnit base = own(d);
    if (d == kLength) return names_[0];
    if (d == kMass) return names_[1];
    if (d == kTime) return names_[2];
    for (const NamedPhysicalUnit& known : kUnits) {
      if (!(known.unit.dimension == d) || d == kNone || d == kAcceleration) continue;
      const double ratio = known.unit.mantissa / base.mantissa * std::pow(10.0, known.unit.power - base.power);
      if (std::abs(ratio - 1) < kSame) return std::string(known.name);
    }
    return "";
  };
  if (std::string whole = name_of_own(dimension); !whole.empty() && dimension != kEnergy && dimension != kFrequency)
    return whole;
  if (words == "energy")
    if (std::string whole = name_of_own(dimension); !whole.empty()) return whole;
  // Word by word: "force*length" is N*mm.
  std::vector<std::pair<std::string, double>> named;
  for (const UnitFactor& part : product_of(words)) {
    if (part.name == "1") continue;
    const Dimension d = parse_dimension(part.name);
    const std::string name = name_of_own(d);
    if (!name.empty())
      named.emplace_back(name, part.exponent);
    else
      for (const auto& [base, exponent] :
           {std::pair{names_[1], d.mass}, std::pair{names_[0], d.length}, std::pair{names_[2], d.time}})
        named.emplace_back(base, exponent * part.exponent);
  }
  std::vector<UnitFactor> parts;
  for (const auto& [name, exponent] : named) parts.push_back({name, exponent});
  return joined_product(parts);
}

double in_units(const std::string& units, double value, std::string_view unit) {
  return units.empty() || units == "SI" ? value : UnitSystem(units).from(value, parse_unit(unit));
}

}  // namespace espalier::dynamics::model
