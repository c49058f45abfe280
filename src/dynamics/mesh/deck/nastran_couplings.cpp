// Couplings of a Nastran deck.
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "dynamics/mesh/deck/nastran_deck.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {

std::vector<int> directions_of(const NastranCard& card, std::size_t k) {
  std::vector<int> out;
  for (const char c : card.field(k)) {
    if (c == '0') continue;
    if (c < '1' || c > '6')
      card.fail(
          fmt::format("field {}: '{}' are no degrees of freedom; they are digits from 1 to 6", k + 2, card.field(k)));
    out.push_back(c - '1');
  }
  return out;
}

bool has_displacements(const std::vector<int>& directions) {
  const auto has = [&](int d) { return std::find(directions.begin(), directions.end(), d) != directions.end(); };
  return has(0) && has(1) && has(2);
}

void add_nastran_coupling(const NastranCard& card, DeckCoupling coupling, Deck& deck) {
  if (std::find(coupling.nodes.begin(), coupling.nodes.end(), coupling.reference) != coupling.nodes.end())
    card.fail(fmt::format("grid point {} depends on itself", node_name(deck.mesh, coupling.reference)));
  if (coupling.nodes.empty()) card.fail("couples no grid points");
  deck.couplings.push_back(std::move(coupling));
}

void read_nastran_mean(const NastranCard& card, const NastranSystems& systems, Deck& deck) {
  const auto leave = [&](const char* what) { leave_card(deck, DeckKind::couplings, what, place_of(card)); };
  DeckCoupling out{place_of(card), grid_point(systems, card, 2), {}, false};
  if (!has_displacements(directions_of(card, 3))) return leave("RBE3 whose reference follows in some directions");
  std::map<Index, double> weights;
  double weight = 1;
  for (std::size_t k = 4; k < card.fields.size(); ++k) {
    const std::string& field = card.field(k);
    if (field.empty()) continue;
    if (upper(field) == "UM") return leave("RBE3 with UM");
    if (upper(field) == "ALPHA") break;
    if (field.find('.') == std::string::npos) {
      if (weight > 0) weights[grid_point(systems, card, k)] += weight;
      continue;
    }
    weight = card.real(k, "weight");
    if (weight < 0)
      card.fail(
          fmt::format("field {}: the weight {:g} is negative; nodes count by weights of 0 and above", k + 2, weight));
    const std::vector<int> directions = directions_of(card, ++k);
    if (!has_displacements(directions)) return leave("RBE3 of some directions");
    if (directions.size() > 3)
      out.notice =
          "the RBE3 counts rotations of its grid points, too; nodes of solids do not turn: the mean is that of "
          "their displacements";
  }
  weigh(weights, out);
  add_nastran_coupling(card, std::move(out), deck);
}

}  // namespace espalier::dynamics
