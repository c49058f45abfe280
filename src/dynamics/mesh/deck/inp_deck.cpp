// The cards of an .inp deck: steps and supports.
#include "dynamics/mesh/deck/inp_deck.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "base/at.hpp"
#include "dynamics/mesh/deck/inp_loads.hpp"
#include "dynamics/mesh/deck/point_algebra.hpp"
#include "dynamics/mesh/inp_model.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

constexpr const char* kDirectionNames[] = {"x", "y", "z", "rotation x", "rotation y", "rotation z"};

/// The six degrees of freedom that a word of *BOUNDARY holds; empty: it is no such word.
std::vector<int> directions_of_word(const std::string& word) {
  if (word == "ENCASTRE") return {0, 1, 2, 3, 4, 5};
  if (word == "PINNED") return {0, 1, 2};
  if (word == "XSYMM") return {0, 4, 5};
  if (word == "YSYMM") return {1, 3, 5};
  if (word == "ZSYMM") return {2, 3, 4};
  if (word == "XASYMM") return {1, 2, 3};
  if (word == "YASYMM") return {0, 2, 4};
  if (word == "ZASYMM") return {0, 1, 5};
  return {};
}

class InpDeckReader {
 public:
  InpDeckReader(const InpModel& model, const InpLookup& lookup, int step, Deck& deck)
      : model_(model), target_(model, lookup, deck), lookup_(lookup), deck_(deck) {
    deck.steps = model.steps;
    wanted_ = step > 0 ? step : std::min(1, model.steps);
    if (step > model.steps)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: there is no step {}; the deck has {}", model.path, step, model.steps));
  }

  void run() {
    for (const InpCard& card : model_.cards)
      if (card.keyword.name == "*AMPLITUDE") amplitudes_.read(card);
    for (const InpCard& card : model_.cards)
      if (card.step <= wanted_) read(card);
    for (const auto& [key, hold] : holds_) deck_.holds.push_back(hold);
    loads_.finish();
    if (deck_.step.kind == DeckStep::Kind::motion)
      for (const InpCard& card : model_.cards)
        if (card.keyword.name == "*DAMPING") leave(DeckKind::others, card.keyword.name, card);
    read_inp_parts(model_, target_);
    read_inp_connectors(model_, target_, wanted_);
    note_formulations();
  }

 private:
  void leave(DeckKind kind, const std::string& what, const InpCard& card) { target_.leave(kind, what, card.place); }

  void read(const InpCard& card) {
    const std::string& name = card.keyword.name;
    if (name == "*STEP") return begin_step(card);
    if (name == "*BOUNDARY") return boundary(card);
    if (name == "*CLOAD") return loads_.cload(card);
    if (name == "*DLOAD" || name == "*DSLOAD") return loads_.dload(card);
    if (name == "*TRANSFORM") return transform(card);
    if (name == "*STATIC" || name == "*FREQUENCY" || name == "*DYNAMIC") return procedure(card);
    if (name.starts_with("*CONNECTOR") || is_inp_part_keyword(name) || name == "*AMPLITUDE" || name == "*ELEMENT" ||
        is_harmless_inp_keyword(name))
      return;
    if (is_inp_material_law(name)) return material_law(card);
    // What *STEP stands for is said by its procedure.
    const bool procedure = card.step > 0 && card.step == wanted_ && card.lines.empty();
    leave(procedure && name != "*MODELCHANGE" ? DeckKind::step : DeckKind::others, name, card);
  }

  /// The law of a material that elements are made of.
  void material_law(const InpCard& card) {
    const auto& sections = lookup_.mesh().section_material;
    if (std::none_of(sections.begin(), sections.end(), [&](const auto& s) { return s.second == card.material; }) &&
        !model_.thin_materials.contains(upper(card.material)))
      return;
    const std::string type = card.keyword.has("TYPE") ? " TYPE=" + upper(card.keyword.get("TYPE")) : "";
    leave(DeckKind::others, fmt::format("{}{} of material {}", card.keyword.name, type, card.material), card);
  }

  void begin_step(const InpCard& card) {
    loads_.begin_step();
    fresh_holds_.clear();
    // NLGEOM stays for the steps that follow.
    if (card.keyword.has("NLGEOM")) deck_.step.large = upper(card.keyword.get("NLGEOM")) != "NO";
    if (card.step != wanted_) {
      large_before_ = large_before_ || deck_.step.large;
      return;
    }
    deck_.step.place = card.place;
    if (wanted_ > 1 && card.keyword.has("PERTURBATION"))
      leave(DeckKind::step, "*STEP PERTURBATION, from the stresses of the step before", card);
  }

  void procedure(const InpCard& card) {
    if (card.step == 0) fail(card.place, fmt::format("{} stands outside of a *STEP", card.keyword.name));
    if (card.step != wanted_) {
      moved_before_ = moved_before_ || card.keyword.name != "*FREQUENCY";
      return;
    }
    DeckStep& step = deck_.step;
    step.place = card.place;
    if (target_.leaves_parameter(card, DeckKind::step,
                                 {"SOLVER", "EIGENSOLVER", "SIM", "ACOUSTICCOUPLING", "STORAGE", "NORMALIZATION",
                                  "DIRECT", "ALPHA", "TIMERESET", "TOTALTIMEATSTART", "EXPLICIT", "NOHAF", "HAFTOL"}))
      return;
    const CardFields f = card.lines.empty() ? CardFields(card.place, "") : card.fields(0);
    if (card.keyword.name == "*FREQUENCY") {
      step.kind = DeckStep::Kind::modes;
      const std::int64_t count = f.integer(0, "number of modes", 0);
      constexpr std::int64_t kMost = 100000;
      if (count < 1 || count > kMost)
        fail(f.place(), fmt::format("*FREQUENCY needs a number of modes from 1 to {}, not {}", kMost, count));
      step.modes = static_cast<int>(count);
      for (const std::size_t bound : {1U, 2U})
        if (f.real(bound, "frequency", 0) > 0)
          deck_.notices.push_back(fmt::format("{}:{}: the lowest {} modes are given, also those {} {}", f.place().file,
                                              f.place().line, count, bound == 1 ? "below" : "above", f.text(bound)));
      if (large_before_) leave(DeckKind::step, "*FREQUENCY under the stresses of a step with NLGEOM", card);
      return;
    }
    step.kind = card.keyword.name == "*STATIC" ? DeckStep::Kind::statics : DeckStep::Kind::motion;
    if (step.kind == DeckStep::Kind::motion && !step.large)
      deck_.notices.push_back(fmt::format(
          "{}:{}: the step has no NLGEOM, which would leave out what large displacements do; here they count",
          card.place.file, card.place.line));
    if (card.keyword.has("EXPLICIT"))
      deck_.notices.push_back(
          fmt::format("{}:{}: *DYNAMIC EXPLICIT is run implicitly, with consistent masses instead of lumped ones",
                      card.place.file, card.place.line));
    if (step.kind == DeckStep::Kind::motion && moved_before_)
      leave(DeckKind::step, "*DYNAMIC from where the steps before it have led", card);
    step.increment = f.real(0, "first increment", 1);
    step.period = f.real(1, "time of the step", 1);
    step.longest = step.kind == DeckStep::Kind::motion ? f.real(3, "largest increment", 0) : 0;
    step.fixed = card.keyword.has("DIRECT");
    if (card.keyword.has("ALPHA")) step.alpha = CardFields(card.place, card.keyword.get("ALPHA")).real(0, "ALPHA");
    if (!(step.increment > 0 && step.period > 0))
      fail(f.place(), fmt::format("{}: increment and time must be above 0", card.keyword.name));
    if (step.kind == DeckStep::Kind::motion && !(step.alpha >= -1.0 / 3 && step.alpha <= 0))
      fail(card.place, "*DYNAMIC: ALPHA must lie between -1/3 and 0");
  }

  void boundary(const InpCard& card) {
    const char* type = upper(card.keyword.get("TYPE")) == "DISPLACEMENT" ? "TYPE" : "OP";
    if (target_.leaves_parameter(card, DeckKind::boundary, {"OP", "AMPLITUDE", type})) return;
    if (loads_.begins_anew(card)) holds_.clear();
    const int curve = amplitudes_.of(card, DeckKind::boundary);
    for (std::size_t l = 0; l < card.lines.size(); ++l) {
      const CardFields f = card.fields(l);
      std::vector<int> directions = directions_of_word(upper(f.text(1)));
      const double value = directions.empty() ? f.real(3, "displacement", 0) : 0;
      if (directions.empty()) {
        const std::int64_t first = f.integer(1, "first degree of freedom"),
                           last = f.integer(2, "last degree of freedom", first);
        if (first == 11 || first == 0 || first > 6) {  // temperatures, voltages, pressures
          leave(DeckKind::boundary, fmt::format("*BOUNDARY of degree of freedom {}", first), card);
          continue;
        }
        if (first < 0 || last < first || last > 6)
          fail(f.place(), fmt::format("*BOUNDARY: degrees of freedom {} to {}; 1 to 3 are displacements, 4 to 6 "
                                      "rotations, the first one stands first",
                                      first, last));
        for (std::int64_t d = first; d <= last; ++d) directions.push_back(static_cast<int>(d - 1));
      }
      for (const Index node : target_.nodes(card, f, 0))
        for (const int d : directions) hold({f.place(), node, d, value, curve});
    }
  }

  void hold(const DeckHold& hold) {
    const std::pair key(hold.node, hold.direction);
    const bool fresh = fresh_holds_.insert(key).second;
    const auto [known, added] = holds_.emplace(key, hold);
    if (added) return;
    if (!fresh && (known->second.value != hold.value || known->second.curve != hold.curve))
      fail(hold.place,
           fmt::format("*BOUNDARY: node {} is to move by {:g} along {}, and by {:g} in line {}; leave one of "
                       "them out",
                       node_name(lookup_.mesh(), hold.node), hold.value, kDirectionNames[hold.direction],
                       known->second.value, known->second.place.line));
    known->second = hold;
  }

  void transform(const InpCard& card) {
    const std::string type = upper(card.keyword.get("TYPE"));
    const std::string set = card.keyword.need(LineReader(card.place.file, ""), "NSET");
    if (card.lines.empty()) fail(card.place, "*TRANSFORM needs a line of six numbers");
    const CardFields f = card.fields(0);
    Point a{}, b{};
    for (std::size_t d = 0; d < 3; ++d) {
      a[d] = f.real(d, "a", 0);
      b[d] = f.real(3 + d, "b", 0);
    }
    if (!type.empty() && type != "R" && type != "C")
      return leave(DeckKind::others, fmt::format("*TRANSFORM TYPE={}", type), card);
    for (const Index node : target_.nodes(card, CardFields(card.place, set), 0)) {
      const auto axes = transform_axes(type == "C", a, b, lookup_.mesh().nodes[at(node)]);
      if (axes[0] == Point{} || axes[2] == Point{})
        fail(f.place(), fmt::format("*TRANSFORM has no axes at node {}", node_name(lookup_.mesh(), node)));
      deck_.axes[node] = axes;
    }
  }

  /// One formulation for all, where the deck's types name one.
  void note_formulations() {
    std::set<std::string> hex8;
    std::set<bool> reduced;
    for (const auto& [type, place] : model_.read_types) {
      if (type.starts_with("C3D8")) hex8.insert(type == "C3D8" ? "full" : type == "C3D8I" ? "enhanced" : "");
      if (type.starts_with("C3D20")) reduced.insert(type.starts_with("C3D20R"));
    }
    if (hex8.size() == 1) deck_.hex8 = *hex8.begin();
    deck_.reduced_hex20 = reduced.size() == 1 && *reduced.begin();
    for (const auto& [type, place] : model_.read_types)
      if ((type.starts_with("C3D8") && deck_.hex8.empty()) || (type.starts_with("C3D20") && reduced.size() > 1) ||
          type.starts_with("C3D10M"))
        deck_.other_elements += fmt::format("{}{}", deck_.other_elements.empty() ? "" : ", ", type);
  }

  const InpModel& model_;
  InpTarget target_;
  InpAmplitudes amplitudes_{target_};
  InpLoads loads_{target_, amplitudes_};
  const InpLookup& lookup_;
  Deck& deck_;
  int wanted_ = 0;
  bool large_before_ = false, moved_before_ = false;  // a step before the wanted one has large displacements; moves
  std::set<std::pair<Index, int>> fresh_holds_;
  std::map<std::pair<Index, int>, DeckHold> holds_;
};

}  // namespace

Deck parse_inp_deck(std::string content, const std::string& name, int step) {
  const InpModel model = parse_inp_text(std::move(content), name, true);
  Deck deck;
  deck.mesh = flatten_inp(model, [&](const InpLookup& lookup) { InpDeckReader(model, lookup, step, deck).run(); });
  return deck;
}

}  // namespace espalier::dynamics
