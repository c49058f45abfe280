/// \file
/// Which pieces of a deck's mesh can move as a whole.
#pragma once

#include <array>
#include <vector>

#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/model/decks/taken.hpp"

namespace espalier::dynamics::model {

struct FreePieces {
  bool any_held = false;                      ///< what is taken holds a piece
  int pieces = 0;                             ///< of solids
  std::vector<std::array<Index, 3>> corners;  ///< three nodes of each other piece, which nothing else leads
};
/// Rows of supports, equations, ties, couplings, springs and connectors, for rigid motions of the pieces; a piece is
/// held where no such motion of it satisfies all rows.
[[nodiscard]] FreePieces free_pieces(const Deck& deck, const DeckChoice& choice);

}  // namespace espalier::dynamics::model
