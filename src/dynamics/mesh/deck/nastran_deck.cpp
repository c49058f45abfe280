#include "dynamics/mesh/deck/nastran_deck.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "base/at.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

/// Cards that change nothing of linear statics and modes of solids, or belong to what the mesh's reader has counted.
bool is_harmless_card(const std::string& name) {
  static constexpr std::string_view kHarmless[] = {
      "PSHELL",  "PCOMP",  "PBAR",    "PBARL",   "PBEAM",  "PROD",   "PELAS",  "PDAMP", "PBUSH", "EIGRL",
      "EIGR",    "SET1",   "TABLEM1", "TABLED1", "MAT8",   "MAT2",   "EPOINT", "ASET",  "ASET1", "USET",
      "MONPNT1", "AECOMP", "AELIST",  "AEFACT",  "AESTAT", "SPOINT", "MAT4",   "MAT5",  "PLOTEL"};
  return std::find(std::begin(kHarmless), std::end(kHarmless), name) != std::end(kHarmless);
}

class NastranDeckReader {
 public:
  NastranDeckReader(const std::vector<NastranCard>& cards, const NastranControl& control, NastranSystems& systems,
                    int wanted, Deck& deck)
      : cards_(cards), control_(control), systems_(systems), deck_(deck) {
    deck.steps = static_cast<int>(control.cases.size());
    if (wanted > deck.steps)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: there is no subcase {}; the deck has {}", deck.mesh.name, wanted, deck.steps));
    case_ = control.cases[static_cast<std::size_t>(std::max(wanted, 1) - 1)];
  }

  void run() {
    for (const NastranCard& card : cards_) note(card);
    case_.spc = chosen(case_.spc, {"SPC", "SPC1", "SPCADD"});
    case_.mpc = chosen(case_.mpc, {"MPC", "MPCADD"});
    case_.load = chosen(case_.load, {"FORCE", "MOMENT", "PLOAD4", "PLOAD2", "PLOAD1", "GRAV", "RFORCE", "LOAD"});
    solution();
    const std::set<std::int64_t> spc = sum_of_sets("SPCADD", case_.spc), mpc = sum_of_sets("MPCADD", case_.mpc);
    for (const NastranCard& card : cards_)
      if (card.name == "GRID") grid_card(card);
    grid_defaults();
    for (const NastranCard& card : cards_) {
      if ((card.name == "SPC" || card.name == "SPC1") && spc.contains(card.integer(0, "set"))) support(card);
      if (card.name == "MPC" && mpc.contains(card.integer(0, "set"))) equation(card);
      read(card);
    }
    for (const auto& [key, hold] : holds_) deck_.holds.push_back(hold);
    if (case_.load) read_nastran_loads(cards_, *case_.load, case_.place, systems_, deck_);
    for (DeckMass& mass : deck_.masses)
      for (std::size_t k = 0; k < deck_.body_loads.size(); ++k) mass.loads.push_back(k);
  }

 private:
  void leave(DeckKind kind, const std::string& what, const DeckPlace& place) { leave_card(deck_, kind, what, place); }

  void note(const NastranCard& card) {
    if (card.name == "PELAS" || card.name == "PDAMP")
      for (const std::size_t k : {0U, card.name == "PELAS" ? 4U : 2U})
        if (!card.field(k).empty()) values_[{card.name, card.integer(k, "property")}] = card.real(k + 1, "value");
    if (card.name == "PBUSH") bushes_[card.integer(0, "property")] = &card;
    if (card.name == "EIGRL" || card.name == "EIGR") methods_[card.integer(0, "set")] = &card;
    if (card.name == "GRDSET") defaults_ = &card;
  }

  /// Where the case control chooses none of a kind: none; where there is no case control, the only one.
  std::optional<std::int64_t> chosen(const std::optional<std::int64_t>& stated,
                                     std::initializer_list<const char*> kinds) {
    if (stated || control_.stated) return stated;
    std::set<std::int64_t> all, sums;
    const NastranCard* last = nullptr;
    for (const NastranCard& card : cards_) {
      const auto is = [&](const char* kind) { return card.name == kind; };
      if (!std::any_of(kinds.begin(), kinds.end(), is)) continue;
      const bool sum = card.name == "LOAD" || card.name.ends_with("ADD");
      (sum ? sums : all).insert(card.integer(0, "set"));
      last = &card;
    }
    const std::set<std::int64_t>& from = sums.empty() ? all : sums;
    if (from.size() > 1)
      last->fail(fmt::format(
          "there are {} sets of such cards, and no case control (before BEGIN BULK) says which is taken", from.size()));
    return from.empty() ? std::nullopt : std::optional(*from.begin());
  }

  static constexpr int kModesBelow = 20;  // where a frequency alone bounds them

  void solution() {
    for (const std::string& word : case_.left) leave(DeckKind::step, word, case_.place);
    DeckStep& step = deck_.step;
    step.place = case_.place;
    const std::string& s = control_.solution;
    if (s.empty() && !case_.load) {  // a mesh
      deck_.steps = 0;
    } else if (s.empty() || s == "101" || s == "1" || s == "SESTATIC" || s == "SESTATICS") {
      step.kind = DeckStep::Kind::statics;
    } else if (s == "103" || s == "3" || s == "SEMODES") {
      step.kind = DeckStep::Kind::modes;
      const auto method = case_.method ? methods_.find(*case_.method) : methods_.begin();
      if (method == methods_.end()) fail(case_.place, "SOL 103 needs METHOD = N and a card EIGRL of that number");
      const NastranCard& card = *method->second;
      const std::size_t count = card.name == "EIGRL" ? 3 : 5, top = count - 1;
      if (card.field(count).empty()) {  // MSC Nastran: all below V2, or one
        step.modes = card.field(top).empty() ? 1 : kModesBelow;
        deck_.notices.push_back(
            fmt::format("{}:{}: {} states no number of modes (ND): {}", card.path, card.line, card.name, step.modes));
      } else {
        step.modes = static_cast<int>(std::clamp<std::int64_t>(card.integer(count, "number of modes"), 0, 100000));
      }
      if (step.modes < 1) card.fail("the number of modes (ND) is not above 0");
      for (const std::size_t bound : {1U, 2U})
        if (const std::size_t k = bound + (card.name == "EIGRL" ? 0 : 1); card.real(k, "frequency", 0) > 0)
          deck_.notices.push_back(fmt::format("{}:{}: the lowest {} modes are given, also those {} {}", card.path,
                                              card.line, step.modes, bound == 1 ? "below" : "above", card.field(k)));
    } else {
      leave(DeckKind::step, fmt::format("SOL {}", s), control_.place);
    }
  }

  /// The sets that an SPCADD or MPCADD adds up.
  std::set<std::int64_t> sum_of_sets(const char* kind, const std::optional<std::int64_t>& set) {
    if (!set) return {};
    std::set<std::int64_t> out = {*set};
    for (const NastranCard& card : cards_)
      if (card.name == kind && card.integer(0, "set") == *set)
        for (std::size_t k = 1; k < card.fields.size(); ++k)
          if (!card.field(k).empty()) out.insert(card.integer(k, "set"));
    return out;
  }

  void read(const NastranCard& card) {
    const std::string& n = card.name;
    if (n == "CELAS1" || n == "CELAS2" || n == "CDAMP1" || n == "CDAMP2") return scalar_spring(card);
    if (n == "CBUSH") return bush(card);
    if (n == "CONM2") return mass(card);
    if (n == "RBE2") return rigid(card);
    if (n == "RBE3") return read_nastran_mean(card, systems_, deck_);
    if (n == "PARAM") return parameter(card);
    if (n == "MAT9" && !is_of_solids(card)) return;
    static constexpr std::string_view kElsewhere[] = {"SPC",    "SPC1",   "SPCADD", "MPC",    "MPCADD",
                                                      "FORCE",  "MOMENT", "LOAD",   "PLOAD4", "PLOAD2",
                                                      "PLOAD1", "GRAV",   "RFORCE", "GRDSET", "GRID"};
    if (std::find(std::begin(kElsewhere), std::end(kElsewhere), n) != std::end(kElsewhere) || is_harmless_card(n))
      return;
    if (!is_load_not_read(n)) leave(DeckKind::others, n, place_of(card));
  }

  [[nodiscard]] bool is_of_solids(const NastranCard& material) const {
    const std::string name = fmt::format("MAT1-{}", material.integer(0, "number"));
    const auto& sections = deck_.mesh.section_material;
    return std::any_of(sections.begin(), sections.end(), [&](const auto& s) { return s.second == name; });
  }
  [[nodiscard]] Index grid(const NastranCard& card, std::size_t k) const { return grid_point(systems_, card, k); }

  /// Grid points of fields from `k` on: labels, and ranges of those that are defined ("1 THRU 9").
  [[nodiscard]] std::vector<Index> grids(const NastranCard& card, std::size_t k) {
    std::vector<Index> out;
    for (; k < card.fields.size(); ++k) {
      if (card.field(k).empty()) continue;
      if (upper(card.field(k + 1)) != "THRU") {
        out.push_back(grid(card, k));
        continue;
      }
      if (by_label_.empty()) by_label_.insert(systems_.nodes().begin(), systems_.nodes().end());
      const std::int64_t first = card.integer(k, "first grid point"), last = card.integer(k + 2, "last grid point");
      for (auto it = by_label_.lower_bound(first); it != by_label_.end() && it->first <= last; ++it) {
        constexpr std::size_t kFree = 1000000, kEach = 100;
        if (++members_ > kFree + kEach * by_label_.size()) card.fail("the ranges up to here name too many grid points");
        out.push_back(it->second);
      }
      k += 2;
    }
    return out;
  }

  void hold(const NastranCard& card, Index node, int direction, double value) {
    const auto [known, added] =
        holds_.try_emplace({node, direction}, DeckHold{place_of(card), node, direction, value, -1});
    if (!added && known->second.value != value)
      card.fail(fmt::format(
          "grid point {} is to move by {:g} in direction {}, and by {:g} in line {}; leave one of them out",
          node_name(deck_.mesh, node), value, direction + 1, known->second.value, known->second.place.line));
  }

  void support(const NastranCard& card) {
    if (card.name == "SPC1") {
      const std::vector<int> directions = directions_of(card, 1);
      for (const Index node : grids(card, 2))
        for (const int d : directions) hold(card, node, d, 0);
      return;
    }
    for (const std::size_t k : {1U, 4U})
      if (!card.field(k).empty())
        for (const int d : directions_of(card, k + 1))
          hold(card, grid(card, k), d, card.real(k + 2, "displacement", 0));
  }

  /// Permanent supports, and axes of displacements.
  void grid_card(const NastranCard& card) {
    const Index node = grid(card, 0);
    if (!card.field(5).empty()) give_axes(card, node, card.integer(5, "system of displacements"));
    if (card.field(6).empty()) return;
    own_supports_.insert(node);
    for (const int d : directions_of(card, 6)) hold(card, node, d, 0);
  }
  /// What GRDSET says holds for those that say nothing.
  void grid_defaults() {
    if (defaults_ == nullptr) return;
    const std::int64_t system = defaults_->integer(5, "system of displacements", 0);
    const std::vector<int> directions = directions_of(*defaults_, 6);
    if (system <= 0 && directions.empty()) return;
    for (const auto& [label, node] : systems_.nodes()) {
      if (!own_axes_.contains(node)) give_axes(*defaults_, node, system);
      if (own_supports_.contains(node)) continue;
      for (const int d : directions) hold(*defaults_, node, d, 0);
    }
  }
  void give_axes(const NastranCard& card, Index node, std::int64_t system) {
    own_axes_.insert(node);
    if (system > 0)  // -1: a point of a fluid
      deck_.axes[node] = systems_.axes(card, system, deck_.mesh.nodes[at(node)], deck_.mesh);
  }

  // Springs, masses, couplings ----------------------------------------------------------------------------------------

  void scalar_spring(const NastranCard& card) {
    const bool damper = card.name.starts_with("CDAMP"), by_property = card.name.ends_with('1');
    double value = 0;
    if (by_property) {
      const auto found = values_.find({damper ? "PDAMP" : "PELAS", card.integer(1, "property")});
      if (found == values_.end())
        card.fail(fmt::format("there is no {} {}", damper ? "PDAMP" : "PELAS", card.integer(1, "property")));
      value = found->second;
    } else {
      value = card.real(1, "value");
    }
    struct End {
      Index node;
      int direction;
    };
    std::vector<End> ends;
    for (const std::size_t k : {2U, 4U}) {
      if (card.field(k).empty() || card.field(k) == "0") continue;
      const std::vector<int> directions = directions_of(card, k + 1);
      if (directions.size() != 1) card.fail(fmt::format("field {}: one degree of freedom is needed", k + 3));
      ends.push_back({grid(card, k), directions.front()});
    }
    if (ends.empty()) card.fail("names no grid point");
    const DeckKind kind = damper ? DeckKind::dashpots : DeckKind::springs;
    if (ends.size() == 2 && ends[0].direction != ends[1].direction)
      return leave(kind, fmt::format("{} between different directions", card.name), place_of(card));
    for (const End& end : ends)
      if (deck_.axes.contains(end.node))
        return leave(kind, fmt::format("{} along axes of a grid point", card.name), place_of(card));
    DeckSpring out{place_of(card), ends[0].node, ends.size() == 2 ? ends[1].node : -1, ends[0].direction, 0, 0};
    (damper ? out.damping : out.stiffness) = value;
    (damper ? deck_.dashpots : deck_.springs).push_back(out);
  }

  void bush(const NastranCard& card) {
    const auto found = bushes_.find(card.integer(1, "property", card.integer(0, "number")));
    if (found == bushes_.end()) card.fail("its PBUSH is not there");
    for (const std::size_t k : {4U, 5U, 6U})
      if (!card.field(k).empty()) return leave(DeckKind::springs, "CBUSH with an orientation vector", place_of(card));
    if (!card.field(7).empty() && card.field(7) != "0")
      return leave(DeckKind::springs, "CBUSH in a coordinate system", place_of(card));
    const NastranCard& property = *found->second;
    const Index a = grid(card, 2), b = card.field(3).empty() || card.field(3) == "0" ? -1 : grid(card, 3);
    if (card.field(7).empty() && deck_.axes.contains(a))
      return leave(DeckKind::springs, "CBUSH without a coordinate system, at axes of a grid point", place_of(card));
    if (b >= 0) {
      const Point &p = deck_.mesh.nodes[at(a)], &q = deck_.mesh.nodes[at(b)];
      if (p != q) return leave(DeckKind::springs, "CBUSH between different places", place_of(card));
    }
    for (std::size_t k = 1; k < property.fields.size(); ++k) {
      const std::string word = upper(property.field(k));
      if (word != "K" && word != "B") continue;
      for (std::size_t d = 0; d < 6; ++d) {
        const double value = property.real(k + 1 + d, "value", 0);
        if (value == 0) continue;
        DeckSpring out{place_of(card), a, b, static_cast<int>(d), 0, 0};
        (word == "K" ? out.stiffness : out.damping) = value;
        (word == "K" ? deck_.springs : deck_.dashpots).push_back(out);
      }
      k += 6;
    }
  }

  void mass(const NastranCard& card) {
    if (const std::int64_t system = card.integer(2, "coordinate system", 0); system != 0)
      return leave(DeckKind::masses, "CONM2 in a coordinate system", place_of(card));
    DeckMass out{place_of(card), grid(card, 1), card.real(3, "mass"), {}, {}};
    if (!(out.mass > 0)) card.fail(fmt::format("the mass, {:g}, is not above 0", out.mass));
    for (std::size_t d = 0; d < 3; ++d) out.offset[d] = card.real(4 + d, "offset", 0);
    constexpr std::size_t kPlaces[] = {8, 10, 13, 9, 11, 12};  // I11, I22, I33, I21, I31, I32
    for (std::size_t k = 0; k < 6; ++k)
      out.inertia[k] = (k < 3 ? 1 : -1) * card.real(kPlaces[k], "moment of inertia", 0);
    deck_.masses.push_back(out);
  }

  /// Most parameters say what is printed, or how it is solved.
  void parameter(const NastranCard& card) {
    const std::string name = upper(card.field(0));
    if (name == "WTMASS" && card.real(1, "value") != 1)
      leave(DeckKind::others, "PARAM WTMASS (state masses and densities in units of mass)", place_of(card));
    if (name == "INREL" && card.integer(1, "value") != 0) leave(DeckKind::others, "PARAM INREL", place_of(card));
  }

  void rigid(const NastranCard& card) {
    DeckCoupling out{place_of(card), grid(card, 1), {}, true};
    const std::vector<int> directions = directions_of(card, 2);
    if (!has_displacements(directions)) return leave(DeckKind::couplings, "RBE2 of some directions", place_of(card));
    NastranCard points = card;  // without the factor of thermal expansion behind the last point
    while (!points.fields.empty() &&
           (points.fields.back().empty() || points.fields.back().find('.') != std::string::npos))
      points.fields.pop_back();
    out.nodes = grids(points, 3);
    sort_unique(out.nodes);
    add_nastran_coupling(card, std::move(out), deck_);
  }

  void equation(const NastranCard& card) {
    DeckEquation out{place_of(card), {}, 0};
    for (std::size_t k = 1; k < card.fields.size(); k += k % 8 == 1 ? 3 : 5) {  // two terms a line, then a blank
      if (card.field(k).empty()) continue;
      const std::vector<int> directions = directions_of(card, k + 1);
      if (directions.size() != 1) card.fail(fmt::format("field {}: one degree of freedom is needed", k + 3));
      out.terms.push_back({grid(card, k), directions.front(), card.real(k + 2, "coefficient")});
    }
    if (out.terms.empty()) card.fail("has no terms");
    deck_.equations.push_back(std::move(out));
  }

  const std::vector<NastranCard>& cards_;
  const NastranControl& control_;
  NastranSystems& systems_;
  Deck& deck_;
  NastranCase case_;
  std::map<std::int64_t, Index> by_label_;
  std::size_t members_ = 0;
  std::map<std::pair<std::string, std::int64_t>, double> values_;  // of PELAS and PDAMP
  std::map<std::int64_t, const NastranCard*> bushes_, methods_;
  const NastranCard* defaults_ = nullptr;  // GRDSET
  std::set<Index> own_axes_, own_supports_;
  std::map<std::pair<Index, int>, DeckHold> holds_;
};

}  // namespace

void read_nastran_deck(const std::vector<NastranCard>& cards, const NastranControl& control, NastranSystems& systems,
                       int wanted, Deck& deck) {
  NastranDeckReader(cards, control, systems, wanted, deck).run();
}

}  // namespace espalier::dynamics
