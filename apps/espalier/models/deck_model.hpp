/// \file
/// A first model of a deck that states its supports, loads and step.
#pragma once

#include <string>

#include "dynamics/mesh/deck/deck.hpp"

namespace espalier::cli {

/// What of a deck a first model takes over.
struct DeckModel {
  bool holds = false;    ///< what is taken runs: it holds the part, with `supports`, or asks for modes
  std::string take;      ///< "all", or a list of words
  std::string left;      ///< comments: what is not taken
  std::string supports;  ///< of pieces that what is left would hold
  std::string run;       ///< a section of the run, where the deck's is not taken
  std::string material;  ///< of steel, where the deck's is not one of ours
};
/// Whether solids are made of materials of the file that a model can take.
/// @param statics  then densities are not needed
[[nodiscard]] bool states_materials(const dynamics::Mesh& mesh, bool statics);
/// @param deck  with a step @param steel  a line of the body, where the deck has no material that we take
[[nodiscard]] DeckModel model_of_deck(const dynamics::Deck& deck, const std::string& steel);

}  // namespace espalier::cli
