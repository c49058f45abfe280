#include "dynamics/mesh/deck/inp_cards.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "dynamics/mesh/deck/point_algebra.hpp"

namespace espalier::dynamics {

void fail(const DeckPlace& place, const std::string& message) {
  throw Error(StatusCode::invalid_input, fmt::format("{}:{}: {}", place.file, place.line, message));
}

void weigh(const std::map<Index, double>& weights, DeckCoupling& coupling) {
  for (const auto& [node, weight] : weights) {
    coupling.nodes.push_back(node);
    coupling.weights.push_back(weight);
  }
  const auto& w = coupling.weights;
  if (std::adjacent_find(w.begin(), w.end(), std::not_equal_to<>()) == w.end()) coupling.weights.clear();
}

CardFields::CardFields(const DeckPlace& place, std::string_view text) : place_(place) {
  for (bool more = true; more;) {
    const std::size_t comma = text.find(',');
    fields_.emplace_back(trim(text.substr(0, comma)));
    more = comma != std::string_view::npos;
    if (more) text.remove_prefix(comma + 1);
  }
  while (!fields_.empty() && fields_.back().empty()) fields_.pop_back();
}

const std::string& CardFields::text(std::size_t k) const {
  static const std::string none;
  return k < fields_.size() ? fields_[k] : none;
}

double CardFields::real(std::size_t k, const char* what) const {
  if (!has(k)) fail(place_, fmt::format("field {} ({}) is missing", k + 1, what));
  std::string text = fields_[k];
  for (char& c : text)  // Fortran's exponents
    if (c == 'd' || c == 'D') c = 'e';
  const char* begin = text.c_str() + (text.front() == '+' ? 1 : 0);
  double value = 0;
  const auto [end, error] = std::from_chars(begin, text.c_str() + text.size(), value);
  if (error != std::errc() || end != text.c_str() + text.size() || !std::isfinite(value))
    fail(place_, fmt::format("field {} ({}): '{}' is not a number", k + 1, what, fields_[k]));
  return value;
}

double CardFields::real(std::size_t k, const char* what, double otherwise) const {
  return has(k) ? real(k, what) : otherwise;
}

std::int64_t CardFields::integer(std::size_t k, const char* what) const {
  if (!has(k)) fail(place_, fmt::format("field {} ({}) is missing", k + 1, what));
  const std::string& text = fields_[k];
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    fail(place_, fmt::format("field {} ({}): '{}' is not a whole number", k + 1, what, text));
  return value;
}

std::int64_t CardFields::integer(std::size_t k, const char* what, std::int64_t otherwise) const {
  return has(k) ? integer(k, what) : otherwise;
}

std::array<Point, 3> transform_axes(bool cylindrical, const Point& a, const Point& b, const Point& place) {
  Point x = direction_of(a), z = direction_of(cross_product(a, b));
  if (cylindrical) {
    z = direction_of(difference_of(b, a));
    x = direction_of(cross_product(cross_product(z, difference_of(place, a)), z));
    // On the axis, where it is one of the coordinate system: as CalculiX has it.
    for (std::size_t d = 0; d < 3 && x == Point{}; ++d)
      if (std::abs(z[d]) == 1) x[(d + 1) % 3] = 1;
  }
  return {x, cross_product(z, x), z};
}

bool is_harmless_inp_keyword(const std::string& name) {
  static constexpr std::string_view kHarmless[] = {"*EXPANSION",       "*CONDUCTIVITY",
                                                   "*SPECIFICHEAT",    "*PHYSICALCONSTANTS",
                                                   "*TIMEPOINTS",      "*SURFACE",
                                                   "*PARAMETER",       "*SECTIONPRINT",
                                                   "*CONTROLS",        "*SOLVERCONTROLS",
                                                   "*ORIENTATION",     "*DAMPING",
                                                   "*CONTACTOUTPUT",   "*SECTIONCONTROLS",
                                                   "*DIAGNOSTICS",     "*FRICTION",
                                                   "*SURFACEBEHAVIOR", "*SURFACEINTERACTION",
                                                   "*DEPVAR",          "*VIEWFACTOR",
                                                   "*SUBMODEL",        "*FILE"};
  return std::find(std::begin(kHarmless), std::end(kHarmless), name) != std::end(kHarmless);
}

bool is_inp_material_law(const std::string& name) {
  static constexpr std::string_view kLaws[] = {"*ELASTIC",
                                               "*PLASTIC",
                                               "*CYCLICHARDENING",
                                               "*CREEP",
                                               "*HYPERELASTIC",
                                               "*HYPERFOAM",
                                               "*HYPOELASTIC",
                                               "*DEFORMATIONPLASTICITY",
                                               "*VISCOELASTIC",
                                               "*VISCOUS",
                                               "*MULLINSEFFECT",
                                               "*MOHRCOULOMB",
                                               "*MOHRCOULOMBHARDENING",
                                               "*DRUCKERPRAGER",
                                               "*CAPPLASTICITY",
                                               "*CONCRETE",
                                               "*CONCRETEDAMAGEDPLASTICITY",
                                               "*DAMAGEINITIATION",
                                               "*POROUSELASTIC",
                                               "*NOCOMPRESSION",
                                               "*NOTENSION",
                                               "*USERMATERIAL"};
  return std::find(std::begin(kLaws), std::end(kLaws), name) != std::end(kLaws);
}

}  // namespace espalier::dynamics
