// Forces, moments, pressures and gravity of a Nastran deck.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <unordered_map>

#include "dynamics/mesh/deck/nastran_deck.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

class NastranLoads {
 public:
  NastranLoads(const std::vector<NastranCard>& cards, const DeckPlace& place, NastranSystems& systems, Deck& deck)
      : cards_(cards), place_(place), systems_(systems), deck_(deck) {
    for (const NastranCard& card : cards)
      for (const char* kind : {"LOAD", "FORCE", "MOMENT", "PLOAD4", "PLOAD2", "PLOAD1", "GRAV", "RFORCE"})
        if (card.name == kind) load_cards_[card.integer(0, "set")].push_back(&card);
    for (Index e = 0; e < deck.mesh.element_count(); ++e) elements_.emplace(deck.mesh.element_label(e), e);
  }

  void run(std::int64_t set) {
    add(set, 1, 0);
    for (const NastranCard& card : cards_)
      if (is_load_not_read(card.name) && sets_.contains(card.integer(0, "set")))
        leave(DeckKind::dload, card.name, place_of(card));
    for (const auto& [key, force] : forces_) deck_.forces.push_back(force);
  }

 private:
  void add(std::int64_t set, double factor, int depth) {
    sets_.insert(set);
    const auto found = load_cards_.find(set);
    if (found == load_cards_.end()) {
      leave(DeckKind::cload, fmt::format("LOAD = {}, which no card states that is read,", set), place_);
      return;
    }
    for (const NastranCard* card : found->second) {
      if (card->name == "LOAD") {
        if (depth > 0) card->fail("adds up sets of forces and pressures, not those of another LOAD");
        const double all = card->real(1, "factor");
        for (std::size_t k = 2; k + 1 < card->fields.size(); k += 2)
          if (!card->field(k + 1).empty())
            add(card->integer(k + 1, "set"), factor * all * card->real(k, "factor"), depth + 1);
      } else if (card->name == "FORCE" || card->name == "MOMENT") {
        force(*card, factor);
      } else if (card->name == "GRAV") {
        const Point g = vector_of(*card, 1, 2, 3, nullptr);
        deck_.body_loads.push_back({place_of(*card), "GRAV", {}, {factor * g[0], factor * g[1], factor * g[2]}});
      } else if (card->name == "RFORCE") {
        rotation(*card, factor);
      } else if (card->name == "PLOAD1") {
        line_load(*card, factor);
      } else if (card->name == "PLOAD2") {
        for (const Index e : shells(*card)) press(*card, e, factor * card->real(1, "pressure"));
      } else {
        pressure(*card, factor);
      }
    }
  }

  /// Magnitude times vector of a card in a system, in basic axes.
  Point vector_of(const NastranCard& card, std::size_t system, std::size_t magnitude, std::size_t first,
                  const Point* at) {
    Point local{}, out{};
    for (std::size_t d = 0; d < 3; ++d)
      local[d] = card.real(magnitude, "magnitude") * card.real(first + d, "direction", 0);
    const std::int64_t id = card.integer(system, "coordinate system", 0);
    if (id == 0) return local;
    const std::array<Point, 3> axes = systems_.axes(card, id, at != nullptr ? *at : Point{1, 0, 0}, deck_.mesh);
    for (std::size_t d = 0; d < 3; ++d)
      for (std::size_t e = 0; e < 3; ++e) out[e] += local[d] * axes[d][e];
    return out;
  }

  /// A rotation about the axis through a grid point; the speed is given in turns.
  void rotation(const NastranCard& card, double factor) {
    if (card.real(8, "angular acceleration", 0) != 0)
      leave(DeckKind::dload, "RFORCE with an angular acceleration", place_of(card));
    if (factor < 0) card.fail(fmt::format("centrifugal forces times {:g} have no speed", factor));
    const std::int64_t at = card.integer(1, "grid point", 0);
    DeckBodyLoad out{place_of(card), "CENTRIF"};
    if (at != 0) out.point = deck_.mesh.nodes[static_cast<std::size_t>(grid(card, 1))];
    out.spin = vector_of(card, 2, 3, 4, nullptr);
    for (double& x : out.spin) x *= 2 * std::numbers::pi * std::sqrt(factor);
    deck_.body_loads.push_back(std::move(out));
  }

  void force(const NastranCard& card, double factor) {
    const Index node = grid(card, 1);
    const Point f = vector_of(card, 2, 3, 4, &deck_.mesh.nodes[static_cast<std::size_t>(node)]);
    const auto axes = deck_.axes.find(node);
    for (std::size_t d = 0; d < 3; ++d) {
      double value = factor * f[d];  // directions are those of the node
      if (axes != deck_.axes.end())
        value = factor * (f[0] * axes->second[d][0] + f[1] * axes->second[d][1] + f[2] * axes->second[d][2]);
      if (value == 0) continue;
      const int direction = static_cast<int>(d) + (card.name == "MOMENT" ? 3 : 0);
      auto [known, added] =
          forces_.try_emplace({node, direction}, DeckForce{place_of(card), node, direction, 0, -1, 0});
      known->second.value += value;
    }
  }

  /// Along the normal of a shell, from its bottom.
  void press(const NastranCard& card, Index element, double value) {
    deck_.pressures.push_back({place_of(card), {element, kShellBottom}, value, -1, 0});
  }

  /// Elements of fields from 2 on: labels, and "1 THRU 9".
  std::vector<Index> shells(const NastranCard& card) {
    std::vector<Index> out;
    const auto add = [&](std::int64_t label, bool needed) {
      const auto found = elements_.find(label);
      if (found == elements_.end() && !needed) return;
      if (found == elements_.end() || shape_of(deck_.mesh.type(found->second)).dimension != 2)
        return leave(DeckKind::dload, card.name + " on elements that are no shells", place_of(card));
      out.push_back(found->second);
    };
    const bool range = upper(card.field(3)) == "THRU";
    const std::int64_t first = card.integer(2, "element"), last = range ? card.integer(4, "element") : first;
    if (range) {
      for (const auto& [label, e] : elements_)
        if (label >= first && label <= last) add(label, false);
      return out;
    }
    for (std::size_t k = 2; k < card.fields.size(); ++k)
      if (!card.field(k).empty()) add(card.integer(k, "element"), true);
    return out;
  }

  /// SID EID TYPE SCALE X1 P1 X2 P2: even over all of a beam, along x, y, z.
  void line_load(const NastranCard& card, double factor) {
    const auto found = elements_.find(card.integer(1, "element"));
    if (found == elements_.end() || shape_of(deck_.mesh.type(found->second)).dimension != 1)
      return leave(DeckKind::dload, "PLOAD1 on elements that are no beams", place_of(card));
    const std::string type = upper(card.field(2)), scale = upper(card.field(3));
    const double first = card.real(5, "P1"), from = card.real(4, "X1", 0), last = card.real(7, "P2", first);
    const auto nodes = deck_.mesh.element(found->second);
    const auto at = [&](std::size_t a) { return deck_.mesh.nodes[static_cast<std::size_t>(nodes[a])]; };
    double length = 0;
    for (std::size_t d = 0; d < 3; ++d) length += (at(1)[d] - at(0)[d]) * (at(1)[d] - at(0)[d]);
    length = std::sqrt(length);
    constexpr double kWhole = 1e-6;
    const double end = card.field(6).empty() ? from : card.real(6, "X2") / (scale == "FR" ? 1 : length);
    const bool axis = type == "FX" || type == "FY" || type == "FZ";
    if (!axis || (scale != "FR" && scale != "LE") || from != 0 || std::abs(end - 1) > kWhole || last != first)
      return leave(DeckKind::dload, "PLOAD1 other than FX, FY, FZ, even over the whole length (LE, FR)",
                   place_of(card));
    DeckLineLoad out{place_of(card), found->second, -1, {}, -1, 0};
    out.force[static_cast<std::size_t>(type[1] - 'X')] = factor * first;
    deck_.line_loads.push_back(out);
  }

  void pressure(const NastranCard& card, double factor) {
    const auto found = elements_.find(card.integer(1, "element"));
    if (found == elements_.end()) return leave(DeckKind::dload, "PLOAD4 on elements that are not read", place_of(card));
    const Index element = found->second;
    const double value = card.real(2, "pressure");
    for (const std::size_t k : {3U, 4U, 5U})
      if (!card.field(k).empty() && card.real(k, "pressure") != value)
        return leave(DeckKind::dload, "PLOAD4 with pressures that differ over the face", place_of(card));
    const bool range = upper(card.field(6)) == "THRU";
    for (std::size_t k = 8; k < card.fields.size(); ++k)
      if (!card.field(k).empty()) return leave(DeckKind::dload, "PLOAD4 along a direction", place_of(card));
    if (range) {
      for (const auto& [label, e] : elements_) {
        if (label < card.integer(1, "element") || label > card.integer(7, "element")) continue;
        if (shape_of(deck_.mesh.type(e)).dimension != 2)
          return leave(DeckKind::dload, "PLOAD4 on several elements that are no shells", place_of(card));
        press(card, e, factor * value);
      }
      return;
    }
    if (shape_of(deck_.mesh.type(element)).dimension == 2) return press(card, element, factor * value);
    if (shape_of(deck_.mesh.type(element)).dimension < 2)
      return leave(DeckKind::dload, "PLOAD4 on elements that are no solids or shells", place_of(card));
    deck_.pressures.push_back({place_of(card), {element, face_of(card, element)}, factor * value, -1, 0});
  }

  /// The face with corner G1, and with G3 opposite to it (of quadrilaterals) or without G4 (of tetrahedra).
  int face_of(const NastranCard& card, Index element) {
    const auto nodes = deck_.mesh.element(element);
    const ElementShape& shape = shape_of(deck_.mesh.type(element));
    const Index first = grid(card, 6), other = card.field(7).empty() ? -1 : grid(card, 7);
    std::vector<int> fitting;
    for (std::size_t f = 0; f < shape.faces.size(); ++f) {
      const auto corners = static_cast<std::size_t>(shape_of(shape.faces[f].type).corners);
      std::size_t at = corners, beside = corners;
      for (std::size_t a = 0; a < corners; ++a) {
        const Index node = nodes[static_cast<std::size_t>(shape.faces[f].nodes[a])];
        if (node == first) at = a;
        if (node == other) beside = a;
      }
      if (at == corners) continue;
      const bool tetrahedron = shape.corners == 4;
      const bool fits = tetrahedron    ? other >= 0 && beside == corners
                        : corners == 4 ? beside != corners && (at + 2) % 4 == beside
                                       : other < 0 || beside != corners;
      if (fits) fitting.push_back(static_cast<int>(f));
    }
    if (fitting.size() != 1)
      card.fail(fmt::format("G1 and G3 (of tetrahedra G4) name {} faces of element {}; one is needed", fitting.size(),
                            element_name(deck_.mesh, element)));
    return fitting.front();
  }

  [[nodiscard]] Index grid(const NastranCard& card, std::size_t k) const { return grid_point(systems_, card, k); }
  void leave(DeckKind kind, const std::string& what, const DeckPlace& place) { leave_card(deck_, kind, what, place); }

  const std::vector<NastranCard>& cards_;
  DeckPlace place_;
  std::set<std::int64_t> sets_;  // that act
  NastranSystems& systems_;
  Deck& deck_;
  std::map<std::int64_t, std::vector<const NastranCard*>> load_cards_;
  std::unordered_map<std::int64_t, Index> elements_;
  std::map<std::pair<Index, int>, DeckForce> forces_;
};

}  // namespace

bool is_load_not_read(const std::string& name) {
  static constexpr std::string_view kLoads[] = {"PLOAD",   "TEMP",  "TEMPD",  "FORCE1", "FORCE2", "MOMENT1",
                                                "MOMENT2", "ACCEL", "ACCEL1", "SPCD",   "DEFORM"};
  return std::find(std::begin(kLoads), std::end(kLoads), name) != std::end(kLoads);
}

Index grid_point(const NastranSystems& systems, const NastranCard& card, std::size_t k) {
  const std::int64_t label = card.integer(k, "grid point");
  const auto found = systems.nodes().find(label);
  if (found == systems.nodes().end()) card.fail(fmt::format("grid point {} is not defined", label));
  return found->second;
}

void leave_card(Deck& deck, DeckKind kind, const std::string& what, const DeckPlace& place) {
  DeckLeft& left = deck.left[{kind, what}];
  if (left.count++ == 0) left.place = place;
}

void read_nastran_loads(const std::vector<NastranCard>& cards, std::int64_t set, const DeckPlace& place,
                        NastranSystems& systems, Deck& deck) {
  NastranLoads(cards, place, systems, deck).run(set);
}

}  // namespace espalier::dynamics
