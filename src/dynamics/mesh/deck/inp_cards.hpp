/// \file
/// Keywords of an .inp deck that say more than its mesh, with their data lines.
#pragma once

#include <array>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/mesh/read/inp_lines.hpp"

namespace espalier::dynamics {

/// Fields of a data line, separated by commas; those left out at the end are empty.
class CardFields {
 public:
  CardFields(const DeckPlace& place, std::string_view text);
  [[nodiscard]] std::size_t size() const { return fields_.size(); }
  [[nodiscard]] bool has(std::size_t k) const { return k < fields_.size() && !fields_[k].empty(); }
  [[nodiscard]] const std::string& text(std::size_t k) const;
  /// @throws Error naming the place and `what` where the field is missing or no finite number
  [[nodiscard]] double real(std::size_t k, const char* what) const;
  [[nodiscard]] double real(std::size_t k, const char* what, double otherwise) const;
  [[nodiscard]] std::int64_t integer(std::size_t k, const char* what) const;
  [[nodiscard]] std::int64_t integer(std::size_t k, const char* what, std::int64_t otherwise) const;
  [[nodiscard]] const DeckPlace& place() const { return place_; }

 private:
  DeckPlace place_;
  std::vector<std::string> fields_;
};

struct InpCard {
  InpKeyword keyword;
  DeckPlace place;
  std::vector<std::pair<std::int64_t, std::string>> lines;
  std::string scope;       ///< upper-case name of the part or instance that it stands in; empty: none
  int step = 0;            ///< 0: before the first
  std::string material{};  ///< the last *MATERIAL before it, as written
  [[nodiscard]] CardFields fields(std::size_t line) const {
    return {DeckPlace{place.file, lines[line].first}, lines[line].second};
  }
};

/// The axes of *TRANSFORM at a place, from its points a and b; zeros where it has none.
[[nodiscard]] std::array<Point, 3> transform_axes(bool cylindrical, const Point& a, const Point& b, const Point& place);

/// Whether a keyword can be left out without a change of displacements: output, heat, names.
[[nodiscard]] bool is_harmless_inp_keyword(const std::string& name);
/// Whether a keyword is a law of the *MATERIAL before it that solids here do not have: plasticity, creep ...
[[nodiscard]] bool is_inp_material_law(const std::string& name);

}  // namespace espalier::dynamics
