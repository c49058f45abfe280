/// \file
/// The entries of a model that a deck stands for, and the sets of its mesh that they name.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {

/// Words of `take`: "all", or some of kDeckWords.
struct DeckChoice {
  bool all = false;
  std::set<DeckKind> kinds;
  [[nodiscard]] bool takes(DeckKind kind) const { return all || kinds.contains(kind); }
};
/// @throws Error(invalid_input) with the place of a word that is none
[[nodiscard]] DeckChoice read_choice(const Value& take);
[[nodiscard]] DeckChoice choice_of(const std::vector<std::string>& words);

struct TakenDeck {
  struct Entry {
    std::string section, name;
    Value value;
  };
  struct Body {
    std::string name, type, element_set;                ///< element_set: empty: all elements of its kind
    std::vector<std::pair<std::string, Value>> keys{};  ///< where the text does not state them
  };
  std::vector<Body> bodies;  ///< that the elements become, the body itself first
  std::vector<Entry> entries;
  std::vector<std::pair<std::string, Value>> run;  ///< sections of the run
  std::map<std::string, std::vector<Index>> node_sets, element_sets;
  std::map<std::string, std::vector<MeshFace>> face_sets;
  std::vector<std::string> notices;
};
/// The same for the same deck and choice, whenever it is asked.
/// @param body  name of the body whose mesh it is
[[nodiscard]] TakenDeck take_deck(const Deck& deck, const DeckChoice& choice, const std::string& body);

}  // namespace espalier::dynamics::model
