// DMIG cards in large fields: MSC Nastran's Quick Reference Guide.
#include <fmt/format.h>

#include <algorithm>

#include "base/strtod.hpp"
#include "dynamics/substructure/write_matrices.hpp"

namespace espalier::dynamics {
namespace {

/// What is not 0 of the lower triangle. @param value of row and column
template <class Value>
std::string cards(const std::string& name, Index rows, std::span<const NodalUnknown> unknowns, const Value& value) {
  std::string out = fmt::format("{:<8}{:<8}{:>8}{:>8}{:>8}{:>8}\n", "DMIG", name, 0, 6, 2, 0);
  for (Index c = 0; c < rows; ++c) {
    const NodalUnknown& column = unknowns[static_cast<std::size_t>(c)];
    bool begun = false;
    for (Index r = c; r < rows; ++r) {
      const std::string text = nastran_field(value(r, c));
      if (text == "0.0") continue;
      if (!begun) out += fmt::format("{:<8}{:<16}{:>16}{:>16}\n", "DMIG*", name, column.node, column.component);
      begun = true;
      const NodalUnknown& row = unknowns[static_cast<std::size_t>(r)];
      out += fmt::format("{:<8}{:>16}{:>16}{:>16}\n", "*", row.node, row.component, text);
    }
  }
  return out;
}

}  // namespace

std::string nastran_field(double value) {
  constexpr std::size_t kWidth = 16;
  if (value == 0) return "0.0";
  std::string best;
  for (int digits = 16; digits >= 1; --digits) {
    std::string text = fmt::format("{:.{}E}", value, digits);
    const std::size_t e = text.find('E');
    std::size_t zeros = e + 2;
    while (zeros + 1 < text.size() && text[zeros] == '0') ++zeros;
    text = text.substr(0, e) + text[e + 1] + text.substr(zeros);  // 1.25-5: the sign stands for the E
    if (text.size() > kWidth) continue;
    best = std::move(text);
    break;
  }
  return best;
}

namespace {

double value_of_field(const std::string& field) {
  const std::size_t sign = field.find_last_of("+-");
  if (sign == std::string::npos || sign == 0) return base::strtod(field.c_str());
  return base::strtod((field.substr(0, sign) + "e" + field.substr(sign)).c_str());
}

}  // namespace

std::string dmig_cards(const NamedMatrix& m, std::span<const NodalUnknown> unknowns) {
  const auto at = [&](Index r, Index c) {
    return m.values[static_cast<std::size_t>(c) * static_cast<std::size_t>(m.rows) + static_cast<std::size_t>(r)];
  };
  std::string out = cards(m.name, m.rows, unknowns, at);
  out += cards(m.name + "L", m.rows, unknowns,
               [&](Index r, Index c) { return at(r, c) - value_of_field(nastran_field(at(r, c))); });
  return out;
}

}  // namespace espalier::dynamics
