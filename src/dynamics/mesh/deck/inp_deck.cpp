// The cards of an .inp deck: steps, supports and loads.
#include "dynamics/mesh/deck/inp_deck.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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
      if (card.keyword.name == "*AMPLITUDE") amplitude(card);
    for (const InpCard& card : model_.cards)
      if (card.step <= wanted_) read(card);
    for (const auto& [key, hold] : holds_) deck_.holds.push_back(hold);
    for (const auto& [key, force] : forces_) deck_.forces.push_back(force);
    for (const auto& [key, pressure] : pressures_) deck_.pressures.push_back(pressure);
    if (deck_.step.kind == DeckStep::Kind::motion)
      for (const InpCard& card : model_.cards)
        if (card.keyword.name == "*DAMPING") leave(DeckKind::others, card.keyword.name, card);
    read_inp_parts(model_, target_);
    note_formulations();
  }

 private:
  void leave(DeckKind kind, const std::string& what, const InpCard& card) { target_.leave(kind, what, card.place); }

  void read(const InpCard& card) {
    const std::string& name = card.keyword.name;
    if (name == "*STEP") return begin_step(card);
    if (name == "*BOUNDARY") return boundary(card);
    if (name == "*CLOAD") return cload(card);
    if (name == "*DLOAD" || name == "*DSLOAD") return dload(card);
    if (name == "*TRANSFORM") return transform(card);
    if (name == "*STATIC" || name == "*FREQUENCY" || name == "*DYNAMIC") return procedure(card);
    if (is_inp_part_keyword(name) || name == "*AMPLITUDE" || name == "*ELEMENT" || is_harmless_inp_keyword(name))
      return;
    // What *STEP stands for is said by its procedure.
    const bool procedure = card.step > 0 && card.step == wanted_ && card.lines.empty();
    leave(procedure && name != "*MODELCHANGE" ? DeckKind::step : DeckKind::others, name, card);
  }

  void begin_step(const InpCard& card) {
    news_.clear();
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
    if (leaves_parameter(card, DeckKind::step,
                         {"SOLVER", "EIGENSOLVER", "SIM", "ACOUSTICCOUPLING", "STORAGE", "NORMALIZATION", "DIRECT",
                          "ALPHA", "TIMERESET", "TOTALTIMEATSTART", "EXPLICIT", "NOHAF", "HAFTOL"}))
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
    step.fixed = card.keyword.has("DIRECT");
    if (card.keyword.has("ALPHA")) step.alpha = CardFields(card.place, card.keyword.get("ALPHA")).real(0, "ALPHA");
    if (!(step.increment > 0 && step.period > 0))
      fail(f.place(), fmt::format("{}: increment and time must be above 0", card.keyword.name));
    if (step.kind == DeckStep::Kind::motion && !(step.alpha >= -1.0 / 3 && step.alpha <= 0))
      fail(card.place, "*DYNAMIC: ALPHA must lie between -1/3 and 0");
  }

  void amplitude(const InpCard& card) {
    const std::string name = upper(card.keyword.need(LineReader(card.place.file, ""), "NAME"));
    for (const auto& [key, given] : card.keyword.parameters) {
      std::string value = upper(given);
      std::erase(value, ' ');
      const bool known = key == "NAME" || (key == "DEFINITION" && value == "TABULAR") ||
                         (key == "TIME" && value == "STEPTIME") || (key == "VALUE" && value == "RELATIVE");
      if (!known) refused_curves_.emplace(name, fmt::format("*AMPLITUDE {}{}{}", key, value.empty() ? "" : "=", value));
    }
    if (refused_curves_.contains(name)) return;
    std::vector<std::pair<double, double>> points;
    for (std::size_t l = 0; l < card.lines.size(); ++l) {
      const CardFields f = card.fields(l);
      for (std::size_t k = 0; k + 1 < f.size() + 1 && f.has(k); k += 2) {
        const double at = f.real(k, "time"), value = f.real(k + 1, "factor");
        if (!points.empty() && !(at > points.back().first))
          fail(f.place(),
               fmt::format("*AMPLITUDE {}: times must rise, {:g} follows {:g}", name, at, points.back().first));
        points.emplace_back(at, value);
      }
    }
    if (points.empty()) fail(card.place, fmt::format("*AMPLITUDE {} has no points", name));
    curves_[name] = static_cast<int>(deck_.curves.size());
    deck_.curves.push_back(std::move(points));
  }

  int curve_of(const InpCard& card, DeckKind kind) {
    if (!card.keyword.has("AMPLITUDE")) return -1;
    const std::string name = upper(card.keyword.get("AMPLITUDE"));
    if (const auto refused = refused_curves_.find(name); refused != refused_curves_.end())
      leave(kind, refused->second, card);
    else if (const auto found = curves_.find(name); found != curves_.end())
      return found->second;
    else
      fail(card.place, fmt::format("{}: there is no *AMPLITUDE '{}'", card.keyword.name, name));
    return -1;
  }

  /// OP=NEW takes away what steps before have said: once in a step.
  bool begins_anew(const InpCard& card) {
    const std::string& name = card.keyword.name;
    return card.step > 0 && upper(card.keyword.get("OP")) == "NEW" &&
           news_.insert(name == "*DSLOAD" ? "*DLOAD" : name).second;
  }

  /// Whether a parameter is given that changes what the card means. @return then it is left
  bool leaves_parameter(const InpCard& card, DeckKind kind, std::initializer_list<const char*> taken) {
    for (const auto& [key, value] : card.keyword.parameters) {
      const auto is = [&key = key](const char* word) { return key == word; };
      if (std::any_of(taken.begin(), taken.end(), is)) continue;
      leave(kind, fmt::format("{} {}{}{}", card.keyword.name, key, value.empty() ? "" : "=", value), card);
      return true;
    }
    return false;
  }

  void boundary(const InpCard& card) {
    const char* type = upper(card.keyword.get("TYPE")) == "DISPLACEMENT" ? "TYPE" : "OP";
    if (leaves_parameter(card, DeckKind::boundary, {"OP", "AMPLITUDE", type})) return;
    if (begins_anew(card)) holds_.clear();
    const int curve = curve_of(card, DeckKind::boundary);
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

  void cload(const InpCard& card) {
    if (leaves_parameter(card, DeckKind::cload, {"OP", "AMPLITUDE"})) return;
    if (begins_anew(card)) forces_.clear();
    const int curve = curve_of(card, DeckKind::cload);
    for (std::size_t l = 0; l < card.lines.size(); ++l) {
      const CardFields f = card.fields(l);
      const std::int64_t direction = f.integer(1, "degree of freedom");
      if (direction == 11 || direction == 0) {
        leave(DeckKind::cload, fmt::format("*CLOAD of degree of freedom {}", direction), card);
        continue;
      }
      if (direction < 1 || direction > 6)
        fail(f.place(), fmt::format("*CLOAD: degree of freedom {}; 1 to 3 are forces, 4 to 6 moments", direction));
      const double value = f.real(2, "force");
      for (const Index node : target_.nodes(card, f, 0)) {
        const std::pair key(node, static_cast<int>(direction - 1));
        const DeckForce force{f.place(), node, key.second, value, curve, card.step};
        add_or_replace(forces_, key, force, card);
      }
    }
  }

  /// In one step loads at the same place add up; those of a step before are replaced.
  template <class Key, class Load>
  void add_or_replace(std::map<Key, Load>& loads, const Key& key, const Load& load, const InpCard& card) {
    const auto [known, added] = loads.emplace(key, load);
    if (added) return;
    if (known->second.step == card.step && known->second.curve == load.curve) {
      known->second.value += load.value;
    } else if (known->second.step == card.step) {
      fail(load.place, fmt::format("{}: the load of line {} acts at the same place with another AMPLITUDE; make one "
                                   "curve of the two",
                                   card.keyword.name, known->second.place.line));
    } else {
      known->second = load;
    }
  }

  void dload(const InpCard& card) {
    if (leaves_parameter(card, DeckKind::dload, {"OP", "AMPLITUDE"})) return;
    if (begins_anew(card)) {
      pressures_.clear();
      deck_.gravity.clear();
    }
    const int curve = curve_of(card, DeckKind::dload);
    for (std::size_t l = 0; l < card.lines.size(); ++l) dload_line(card, card.fields(l), curve);
  }

  void dload_line(const InpCard& card, const CardFields& f, int curve) {
    const std::string label = upper(f.text(1));
    const bool surface = card.keyword.name == "*DSLOAD";
    if (label == "GRAV" && !surface) return gravity(card, f, curve);
    const bool face = label.size() == 2 && label[0] == 'P' && label[1] >= '1' && label[1] <= '6';
    if (surface ? label != "P" : !face)
      return leave(DeckKind::dload, fmt::format("{} {}", card.keyword.name, label), card);
    std::vector<MeshFace> faces;
    if (surface) {
      faces = target_.faces(card, f);
    } else {
      for (const Index e : target_.elements(card, f)) {
        const auto& shape = shape_of(lookup_.mesh().type(e));
        if (shape.dimension < 3) {
          leave(DeckKind::dload, fmt::format("*DLOAD {} of {}", label, shape.name), card);
          continue;
        }
        if (label[1] - '0' > static_cast<int>(shape.faces.size()))
          fail(f.place(), fmt::format("*DLOAD {}: element {} ({}) has {} faces", label, element_name(lookup_.mesh(), e),
                                      shape.name, shape.faces.size()));
        faces.push_back({e, label[1] - '1'});
      }
    }
    const double value = f.real(2, "pressure");
    if (faces.empty()) leave(DeckKind::dload, fmt::format("{} of elements that are not read", card.keyword.name), card);
    for (const MeshFace& at : faces)
      add_or_replace(pressures_, at, DeckPressure{f.place(), at, value, curve, card.step}, card);
  }

  void gravity(const InpCard& card, const CardFields& f, int curve) {
    const double value = f.real(2, "acceleration");
    const Point direction = direction_of({f.real(3, "x", 0), f.real(4, "y", 0), f.real(5, "z", 0)});
    if (direction == Point{}) fail(f.place(), "*DLOAD GRAV: the direction is zero");
    if (curve >= 0) return leave(DeckKind::gravity, "*DLOAD GRAV with AMPLITUDE", card);
    DeckGravity g{f.place(),
                  f.has(0) ? target_.elements(card, f) : std::vector<Index>(),
                  {},
                  card.step,
                  upper(f.text(0)),
                  lookup_.homes(card.scope)};
    for (std::size_t d = 0; d < 3; ++d) g.acceleration[d] = value * direction[d];
    // A step replaces what the ones before say of the same elements; in CalculiX gravity in another direction is added.
    std::erase_if(deck_.gravity, [&](const DeckGravity& old) {
      const bool same = old.set == g.set || (!g.elements.empty() && old.elements == g.elements);
      const Point was = direction_of(old.acceleration);
      const double along = was[0] * direction[0] + was[1] * direction[1] + was[2] * direction[2];
      constexpr double kNear = 1e-10;
      if (old.step != card.step && same && std::abs(along) < 1 - kNear)
        leave(DeckKind::gravity, "*DLOAD GRAV in another direction than in the step before, without OP=NEW", card);
      return old.step != card.step && same;
    });
    deck_.gravity.push_back(std::move(g));
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
      const auto axes = transform_axes(type == "C", a, b, lookup_.mesh().nodes[static_cast<std::size_t>(node)]);
      if (axes[0] == Point{} || axes[2] == Point{})
        fail(f.place(), fmt::format("*TRANSFORM has no axes at node {}", node_name(lookup_.mesh(), node)));
      deck_.axes[node] = axes;
    }
  }

  /// One formulation for all, where the deck's types name one.
  void note_formulations() {
    std::set<std::string> hex8;
    std::set<bool> reduced;
    for (const std::string& type : model_.solid_types) {
      if (type.starts_with("C3D8")) hex8.insert(type == "C3D8" ? "full" : type == "C3D8I" ? "enhanced" : "");
      if (type.starts_with("C3D20")) reduced.insert(type.starts_with("C3D20R"));
    }
    if (hex8.size() == 1) deck_.hex8 = *hex8.begin();
    deck_.reduced_hex20 = reduced.size() == 1 && *reduced.begin();
    for (const std::string& type : model_.solid_types)
      if ((type.starts_with("C3D8") && deck_.hex8.empty()) || (type.starts_with("C3D20") && reduced.size() > 1) ||
          type.starts_with("C3D10M"))
        deck_.other_elements += fmt::format("{}{}", deck_.other_elements.empty() ? "" : ", ", type);
  }

  const InpModel& model_;
  InpTarget target_;
  const InpLookup& lookup_;
  Deck& deck_;
  int wanted_ = 0;
  bool large_before_ = false, moved_before_ = false;  // a step before the wanted one has large displacements; moves
  std::map<std::string, int> curves_;
  std::map<std::string, std::string> refused_curves_;
  std::set<std::string> news_;  // keywords whose OP=NEW this step has seen
  std::set<std::pair<Index, int>> fresh_holds_;
  std::map<std::pair<Index, int>, DeckHold> holds_;
  std::map<std::pair<Index, int>, DeckForce> forces_;
  std::map<MeshFace, DeckPressure> pressures_;
};

}  // namespace

Deck parse_inp_deck(std::string content, const std::string& name, int step) {
  const InpModel model = parse_inp_text(std::move(content), name, true);
  Deck deck;
  deck.mesh = flatten_inp(model, [&](const InpLookup& lookup) { InpDeckReader(model, lookup, step, deck).run(); });
  return deck;
}

}  // namespace espalier::dynamics
