/// \file
/// The case control of a Nastran deck: what stands before BEGIN BULK.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/mesh/deck/deck.hpp"

namespace espalier::dynamics {

/// What one subcase takes of the bulk data; nothing: it does not say.
struct NastranCase {
  DeckPlace place;
  std::optional<std::int64_t> load, spc, mpc, method;
  std::vector<std::string> left;  ///< commands that cannot be taken: TEMP, DLOAD, ...
};
struct NastranControl {
  std::string solution;  ///< "101", "SESTATIC", ...; empty: none is stated
  DeckPlace place;
  std::vector<NastranCase> cases;  ///< never empty
  bool stated = false;             ///< there is a BEGIN BULK
};
/// @throws Error naming the line of a set that is no number
[[nodiscard]] NastranControl read_nastran_control(std::string_view content, const std::string& name);

}  // namespace espalier::dynamics
