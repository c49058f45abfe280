#include "models/deck_model.hpp"

#include <fmt/format.h>

#include <array>
#include <set>

#include "dynamics/model/assembly/solid_materials.hpp"
#include "dynamics/model/decks/held_pieces.hpp"
#include "dynamics/model/decks/taken.hpp"

namespace espalier::cli {
namespace {

using dynamics::Deck;
using dynamics::DeckKind;
using dynamics::model::DeckChoice;

/// What others hold on to comes first.
constexpr std::array<DeckKind, 12> kOrder = {DeckKind::masses,    DeckKind::couplings, DeckKind::boundary,
                                             DeckKind::equations, DeckKind::ties,      DeckKind::connectors,
                                             DeckKind::springs,   DeckKind::dashpots,  DeckKind::cload,
                                             DeckKind::dload,     DeckKind::gravity,   DeckKind::step};

/// All that can be taken together. @param left  a comment for each word that cannot
DeckChoice what_can_be_taken(const Deck& deck, std::string& left) {
  DeckChoice choice;
  std::set<DeckKind> not_ours;
  for (const auto& [key, what] : deck.left) {
    not_ours.insert(key.first);
    left += fmt::format("#   {} ({}, the first in line {})\n", key.second, what.count, what.place.line);
  }
  for (const DeckKind kind : kOrder) {
    if (not_ours.contains(kind)) continue;
    choice.kinds.insert(kind);
    try {
      (void)dynamics::model::take_deck(deck, choice, "part");
    } catch (const Error& error) {
      left += fmt::format("#   {}: {}\n", name_of(dynamics::kDeckWords, kind), error.what());
      choice.kinds.erase(kind);
    }
  }
  choice.all = choice.kinds.size() == kOrder.size() && not_ours.empty();
  return choice;
}

std::string words_of(const DeckChoice& choice) {
  if (choice.all) return "\"all\"";
  std::string words;
  for (const DeckKind kind : choice.kinds)
    words += fmt::format("{}\"{}\"", words.empty() ? "" : ", ", name_of(dynamics::kDeckWords, kind));
  return "[" + words + "]";
}

}  // namespace

bool states_materials(const dynamics::Mesh& mesh, bool statics) {
  std::vector<Index> solids;
  for (Index e = 0; e < mesh.element_count(); ++e)
    if (dynamics::is_simulated_solid(mesh.type(e))) solids.push_back(e);
  if (solids.empty()) return true;  // sections of others have theirs
  bool massless = false;
  try {
    (void)dynamics::model::solid_materials(mesh, {}, solids, statics, massless);
    return true;
  } catch (const Error&) {
    return false;
  }
}

DeckModel model_of_deck(const Deck& deck, const std::string& steel) {
  DeckModel out;
  std::string left;
  const DeckChoice choice = what_can_be_taken(deck, left);
  out.take = words_of(choice);
  if (!left.empty()) out.left = "# Not taken, since it cannot be; the answer is another one without:\n" + left;
  const dynamics::model::FreePieces free = dynamics::model::free_pieces(deck, choice);
  // A free structure has modes, too.
  out.holds = free.any_held || (choice.takes(DeckKind::step) && deck.step.kind == dynamics::DeckStep::Kind::modes);
  if (!free.corners.empty())
    out.supports =
        "\n# What is taken does not hold these pieces of the mesh, so that three nodes of each are held here. Put "
        "there\n"
        "# what joins them: contacts, ties, springs.\n[supports]\n";
  for (std::size_t k = 0; k < free.corners.size(); ++k)
    out.supports += fmt::format("piece_{} = {{ body = \"part\", nodes = [{}, {}, {}], hold = \"all\" }}\n", k + 1,
                                deck.mesh.node_label(free.corners[k][0]), deck.mesh.node_label(free.corners[k][1]),
                                deck.mesh.node_label(free.corners[k][2]));
  if (!choice.takes(DeckKind::step) || deck.step.kind == dynamics::DeckStep::Kind::none)
    out.run = "\n[statics]\nlinear = true\n";
  if (!states_materials(deck.mesh, out.run.empty() ? deck.step.kind == dynamics::DeckStep::Kind::statics : true))
    out.material = steel;
  return out;
}

}  // namespace espalier::cli
