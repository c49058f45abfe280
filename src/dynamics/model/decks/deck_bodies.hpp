/// \file
/// The bodies that the elements of a deck become, and the nodes where they hang together.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/mesh/deck/deck.hpp"

namespace espalier::dynamics::model {

struct DeckBody {
  std::string name, type;       ///< of the model; type: "solid", "shell", "beam" or "cable" (bars)
  std::vector<Index> elements;  ///< rising
};

/// All solids are one body, all beams, all bars. Shells are one for each section, and where walls branch or fold
/// sharply one for each wall.
struct DeckBodies {
  std::vector<DeckBody> list;
  std::vector<int> of_element;  ///< place in the list, -1: none
  std::vector<int> home;        ///< of nodes: the body that stands for them in supports and loads, -1: none
  std::vector<char> turned;     ///< of elements: shells whose normal is turned to that of the first of their wall
  std::vector<std::string> notices{};
  /// Nodes that a body shares with their home, by both places in the list: its own, that of the home.
  std::map<std::pair<int, int>, std::vector<Index>> shared;
};

/// @param all  all kinds; else solids alone, where there are some @param name  of the first body
/// @throws Error(invalid_input) for elements without a section, or with two
[[nodiscard]] DeckBodies make_deck_bodies(const Deck& deck, bool all, const std::string& name);

}  // namespace espalier::dynamics::model
