// Springs, dashpots, masses, equations, couplings and ties of an .inp deck.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "dynamics/mesh/deck/inp_deck.hpp"
#include "dynamics/mesh/deck/point_algebra.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

/// An element that is no solid, surface or line.
struct Single {
  std::string type, set;  ///< upper case
  std::int64_t label = 0;
  const InpCard* card = nullptr;
  CardFields fields;
  bool stated = false;  ///< its values are known
};

class InpPartReader {
 public:
  InpPartReader(const InpModel& model, const InpTarget& target)
      : model_(model), target_(target), deck_(target.deck()) {}

  void run() {
    collect_elements();
    for (const InpCard& card : model_.cards) read(card);
    for (const Single& single : singles_)
      if (!single.stated && single.type != "CONN3D2") leave_element(single);
    for (const auto& [type, place] :
         model_.read_types)  // membranes, plane elements; a bar's third node would be a hinge
      if (type.starts_with("M3D") || type.starts_with("CP") || type.starts_with("CAX") || type.starts_with("T3D3"))
        target_.leave(DeckKind::others, fmt::format("elements {}", type), place);
    turn_rotation_nodes();
  }

 private:
  void collect_elements() {
    for (const InpCard& card : model_.cards) {
      if (card.keyword.name != "*ELEMENT") continue;
      for (std::size_t l = 0; l < card.lines.size(); ++l) {
        const CardFields f = card.fields(l);
        singles_.push_back({upper(card.keyword.get("TYPE")), upper(card.keyword.get("ELSET")),
                            f.integer(0, "element number"), &card, f, false});
      }
    }
  }

  void leave_element(const Single& single) {
    const bool rigid = single.type.starts_with("R3D") && !deck_.couplings.empty();  // faces of rigid bodies
    const DeckKind kind = single.type.starts_with("SPRING")                   ? DeckKind::springs
                          : single.type.starts_with("DASHPOT")                ? DeckKind::dashpots
                          : single.type == "MASS" || single.type == "ROTARYI" ? DeckKind::masses
                          : single.type == "DCOUP3D"                          ? DeckKind::couplings
                                                                              : DeckKind::others;
    if (!rigid) target_.leave(kind, fmt::format("elements {}", single.type), single.fields.place());
  }

  void read(const InpCard& card) {
    const std::string& name = card.keyword.name;
    if (name == "*SPRING" || name == "*DASHPOT") return spring(card);
    if (name == "*MASS") return mass(card);
    if (name == "*EQUATION") return equations(card);
    if (name == "*MPC") return read_inp_mpc(card, target_);
    if (name == "*RIGIDBODY") return rigid_body(card);
    if (name == "*COUPLING" || name == "*KINEMATICCOUPLING") return coupling(card);
    if (name == "*KINEMATIC" || name == "*DISTRIBUTING") return constraint(card);
    if (name == "*DISTRIBUTINGCOUPLING") return old_distributing(card);
    if (name == "*TIE") return tie(card);
    if (!is_inp_part_keyword(name)) return;
    target_.leave(name == "*ROTARYINERTIA" ? DeckKind::masses : DeckKind::others, name, card.place);
  }

  /// Calls take(element) for those of the card's set.
  template <class Take>
  void of_set(const InpCard& card, const Take& take) {
    const std::string set = upper(card.keyword.need(LineReader(card.place.file, ""), "ELSET"));
    const std::vector<std::string> homes = target_.lookup().homes(card.scope);
    for (Single& single : singles_)
      if (is_in(single, set, homes)) take(single);
  }
  /// @param set  upper case
  [[nodiscard]] bool is_in(const Single& single, const std::string& set, const std::vector<std::string>& homes) const {
    return single.set == set || std::any_of(homes.begin(), homes.end(), [&](const std::string& home) {
             return target_.lookup().in_element_set(single.label, set, home);
           });
  }

  void spring(const InpCard& card) {
    const bool dashpot = card.keyword.name == "*DASHPOT";
    if (target_.leaves_parameter(card, dashpot ? DeckKind::dashpots : DeckKind::springs, {"ELSET"})) {
      of_set(card, [](Single& single) { single.stated = true; });
      return;
    }
    if (card.lines.empty()) fail(card.place, fmt::format("{} has no value", card.keyword.name));
    of_set(card, [&](Single& single) {
      const std::string kind = dashpot ? "DASHPOT" : "SPRING";
      if (!single.type.starts_with(kind)) return;
      single.stated = true;
      const std::string which = single.type.substr(kind.size());
      if (which != "1" && which != "2" && which != "A") return leave_element(single);
      const std::size_t value_line = which == "A" && card.lines.size() == 1 ? 0 : 1;
      if (card.lines.size() <= value_line)
        fail(card.place, fmt::format("{} of {}: a line with degrees of freedom and a line with the value are needed",
                                     card.keyword.name, single.type));
      DeckSpring out{single.fields.place(), target_.node(*single.card, single.fields, 1)};
      if (which != "1") out.b = target_.node(*single.card, single.fields, 2);
      if (out.a == out.b)
        fail(single.fields.place(), fmt::format("element {} of type {} has one node twice", single.label, single.type));
      const CardFields values = card.fields(value_line);
      (dashpot ? out.damping : out.stiffness) = values.real(0, dashpot ? "coefficient" : "stiffness");
      if (which != "A") {
        const CardFields f = card.fields(0);
        const std::int64_t first = f.integer(0, "degree of freedom"),
                           second = f.integer(1, "second degree of freedom", first);
        if (first < 1 || first > 6 || second < 1 || second > 6)
          fail(f.place(), fmt::format("{}: degrees of freedom are 1 to 6, not {}", card.keyword.name,
                                      first < 1 || first > 6 ? first : second));
        if (which == "2" && first != second)
          return target_.leave(dashpot ? DeckKind::dashpots : DeckKind::springs,
                               fmt::format("{}2 between different directions", kind), card.place);
        out.direction = static_cast<int>(first - 1);
      }
      (dashpot ? deck_.dashpots : deck_.springs).push_back(out);
    });
  }

  void mass(const InpCard& card) {
    if (target_.leaves_parameter(card, DeckKind::masses, {"ELSET"})) return;
    if (card.lines.empty()) fail(card.place, "*MASS has no value");
    const CardFields f = card.fields(0);
    const double value = f.real(0, "mass");
    if (!(value > 0)) fail(f.place(), fmt::format("*MASS: {:g} is not above 0", value));
    of_set(card, [&](Single& single) {
      if (single.type != "MASS") return;
      single.stated = true;
      DeckMass out{single.fields.place(), target_.node(*single.card, single.fields, 1), value, {}, {}};
      for (std::size_t k = 0; k < deck_.body_loads.size(); ++k)
        if (const DeckBodyLoad& load = deck_.body_loads[k]; load.set.empty() || is_in(single, load.set, load.homes))
          out.loads.push_back(k);
      deck_.masses.push_back(out);
    });
  }

  void equations(const InpCard& card) {
    if (card.keyword.has("REMOVE")) return target_.leave(DeckKind::equations, "*EQUATION REMOVE", card.place);
    for (std::size_t l = 0; l < card.lines.size();) {
      const CardFields head = card.fields(l++);
      const std::int64_t terms = head.integer(0, "number of terms");
      constexpr std::int64_t kMost = 1000000;
      if (terms < 1 || terms > kMost)
        fail(head.place(), fmt::format("*EQUATION: {} terms; the number of terms stands first", terms));
      DeckEquation out{head.place(), {}, 0};
      while (static_cast<std::int64_t>(out.terms.size()) < terms) {
        if (l == card.lines.size())
          fail(head.place(), fmt::format("*EQUATION: {} terms are announced, {} are there", terms, out.terms.size()));
        const CardFields f = card.fields(l++);
        for (std::size_t k = 0; k < f.size() && static_cast<std::int64_t>(out.terms.size()) < terms; k += 3) {
          const std::int64_t direction = f.integer(k + 1, "degree of freedom");
          if (direction < 1 || direction > 6)
            fail(f.place(), fmt::format("*EQUATION: degree of freedom {}; they are 1 to 6", direction));
          out.terms.push_back(
              {target_.node(card, f, k), static_cast<int>(direction - 1), f.real(k + 2, "coefficient")});
        }
      }
      deck_.equations.push_back(std::move(out));
    }
  }

  Index reference(const InpCard& card) {
    const std::string given = card.keyword.need(LineReader(card.place.file, ""), "REFNODE");
    return target_.node(card, CardFields(card.place, given), 0);
  }

  void rigid_body(const InpCard& card) {
    if (target_.leaves_parameter(card, DeckKind::couplings,
                                 {"NSET", "ELSET", "REFNODE", "ROTNODE", "TIENSET", "PINNSET"}))
      return;
    DeckCoupling out{card.place, reference(card), {}, true};
    for (const char* key : {"NSET", "TIENSET", "PINNSET"})
      if (card.keyword.has(key)) {
        const std::vector<Index> more = target_.nodes(card, CardFields(card.place, card.keyword.get(key)), 0);
        out.nodes.insert(out.nodes.end(), more.begin(), more.end());
      }
    if (card.keyword.has("ELSET"))
      for (const Index e : target_.elements(card, CardFields(card.place, card.keyword.get("ELSET")))) {
        const auto nodes = target_.lookup().mesh().element(e);
        out.nodes.insert(out.nodes.end(), nodes.begin(), nodes.end());
      }
    sort_unique(out.nodes);
    if (card.keyword.has("ROTNODE"))
      rotation_nodes_[target_.node(card, CardFields(card.place, card.keyword.get("ROTNODE")), 0)] = out.reference;
    add_coupling(std::move(out));
  }

  void coupling(const InpCard& card) {
    const bool old = card.keyword.name == "*KINEMATICCOUPLING";
    open_.reset();
    left_open_ = target_.leaves_parameter(card, DeckKind::couplings, {"REFNODE", "SURFACE", "CONSTRAINTNAME"});
    if (left_open_) return;
    DeckCoupling out{card.place, reference(card), {}, true};
    if (!old) {
      const std::string surface = card.keyword.need(LineReader(card.place.file, ""), "SURFACE");
      out.nodes = target_.surface_nodes(card, CardFields(card.place, surface), 0, &out.faces);
      open_ = std::move(out);
      return;
    }
    for (std::size_t l = 0; l < card.lines.size(); ++l) {
      const CardFields f = card.fields(l);
      if (f.integer(1, "degree of freedom", 1) != 1 || f.integer(2, "degree of freedom", f.size() > 1 ? 1 : 6) < 3)
        return target_.leave(DeckKind::couplings, "*KINEMATIC COUPLING of some directions", card.place);
      const std::vector<Index> more = target_.nodes(card, f, 0);
      out.nodes.insert(out.nodes.end(), more.begin(), more.end());
    }
    sort_unique(out.nodes);
    add_coupling(std::move(out));
  }

  /// The kind of the *COUPLING before it.
  void constraint(const InpCard& card) {
    if (left_open_) return;
    if (!open_) fail(card.place, fmt::format("{} stands without a *COUPLING before it", card.keyword.name));
    if (upper(card.keyword.get("WEIGHTINGMETHOD")) != "UNIFORM" &&
        target_.leaves_parameter(card, DeckKind::couplings, {}))
      return;
    open_->rigid = card.keyword.name == "*KINEMATIC";
    std::array<bool, 6> held{};
    for (std::size_t l = 0; l < card.lines.size(); ++l) {
      const CardFields f = card.fields(l);
      const std::int64_t first = f.integer(0, "degree of freedom"),
                         last = f.integer(1, "last degree of freedom", first);
      if (first < 1 || last < first || last > 6)
        fail(f.place(),
             fmt::format("{}: degrees of freedom {} to {}; they are 1 to 6", card.keyword.name, first, last));
      for (std::int64_t d = first; d <= last; ++d) held[static_cast<std::size_t>(d - 1)] = true;
    }
    const bool all = card.lines.empty() || (held[0] && held[1] && held[2]);
    if (all)
      add_coupling(std::move(*open_));
    else
      target_.leave(DeckKind::couplings, fmt::format("{} of some directions", card.keyword.name), card.place);
    open_.reset();
  }

  /// The equation of an element DCOUP3D: the sum of w_k (u_k - u) is 0, as in CalculiX, wherever the reference lies.
  void old_distributing(const InpCard& card) {
    if (target_.leaves_parameter(card, DeckKind::couplings, {"ELSET"})) return;
    DeckCoupling out{card.place, -1, {}, false};
    of_set(card, [&](Single& single) {
      if (single.type != "DCOUP3D") return;
      single.stated = true;
      if (out.reference >= 0) fail(card.place, "*DISTRIBUTING COUPLING: its set has several elements DCOUP3D");
      out.reference = target_.node(*single.card, single.fields, 1);
    });
    if (out.reference < 0) fail(card.place, "*DISTRIBUTING COUPLING: its set has no element DCOUP3D");
    std::map<Index, double> weights;
    for (std::size_t l = 0; l < card.lines.size(); ++l) {
      const CardFields f = card.fields(l);
      const double weight = f.real(1, "weight", 1);
      if (weight < 0) fail(f.place(), fmt::format("*DISTRIBUTING COUPLING: the weight {:g} is negative", weight));
      if (weight > 0)
        for (const Index n : target_.nodes(card, f, 0)) weights[n] += weight;
    }
    if (weights.contains(out.reference))
      fail(card.place, "*DISTRIBUTING COUPLING: its reference node is coupled to itself");
    out.turns = false;
    weigh(weights, out);
    if (!is_central(out))
      out.notice =
          "*DISTRIBUTING COUPLING is taken as CalculiX takes it: forces act in the weighted mean of its nodes, "
          "wherever the reference node lies; Abaqus adds their moment about that mean, which *COUPLING with "
          "*DISTRIBUTING has here, too";
    add_coupling(std::move(out));
  }

  /// Whether the reference lies in the mean of the nodes.
  [[nodiscard]] bool is_central(const DeckCoupling& c) const {
    const auto at = [&](Index n) { return target_.lookup().mesh().nodes[static_cast<std::size_t>(n)]; };
    constexpr double kNear = 1e-6;
    Point sum{};
    double all = 0, far = 0;
    for (std::size_t k = 0; k < c.nodes.size(); ++k) {
      const double w = c.weights.empty() ? 1 : c.weights[k];
      const Point arm = difference_of(at(c.nodes[k]), at(c.reference));
      sum = difference_of(sum, scaled_by(-w, arm));
      all += w;
      far = std::max(far, std::sqrt(dot_product(arm, arm)));
    }
    return std::sqrt(dot_product(sum, sum)) <= kNear * far * all;
  }

  void add_coupling(DeckCoupling out) {
    std::erase(out.nodes, out.reference);
    if (out.nodes.empty()) fail(out.place, "the coupling has no nodes beside its reference node");
    deck_.couplings.push_back(std::move(out));
  }

  void tie(const InpCard& card) {
    if (target_.leaves_parameter(card, DeckKind::ties, {"NAME", "POSITIONTOLERANCE", "ADJUST", "TYPE"})) return;
    for (std::size_t l = 0; l < card.lines.size(); ++l) {
      const CardFields f = card.fields(l);
      DeckTie out{f.place(), target_.surface_nodes(card, f, 0), target_.faces(card, f, 1), 0};
      if (out.faces.empty()) fail(f.place(), fmt::format("*TIE: the surface '{}' has no faces of solids", f.text(1)));
      if (card.keyword.has("POSITIONTOLERANCE"))
        out.tolerance = CardFields(card.place, card.keyword.get("POSITIONTOLERANCE")).real(0, "POSITION TOLERANCE");
      deck_.ties.push_back(std::move(out));
    }
  }

  /// CalculiX's rotations of a rigid body are displacements of a node of their own.
  void turn_rotation_nodes() {
    const auto turn = [&](auto& list) {
      for (auto& item : list)
        if (const auto found = rotation_nodes_.find(item.node); found != rotation_nodes_.end() && item.direction < 3) {
          item.node = found->second;
          item.direction += 3;
        }
    };
    turn(deck_.holds);
    turn(deck_.forces);
  }

  const InpModel& model_;
  const InpTarget& target_;
  Deck& deck_;
  std::vector<Single> singles_;
  std::optional<DeckCoupling> open_;
  bool left_open_ = false;  // the last *COUPLING is left
  std::map<Index, Index> rotation_nodes_;
};

}  // namespace

bool is_inp_part_keyword(const std::string& name) {
  static constexpr std::string_view kParts[] = {"*SPRING",
                                                "*DASHPOT",
                                                "*MASS",
                                                "*ROTARYINERTIA",
                                                "*EQUATION",
                                                "*MPC",
                                                "*TIE",
                                                "*COUPLING",
                                                "*KINEMATIC",
                                                "*DISTRIBUTING",
                                                "*DISTRIBUTINGCOUPLING",
                                                "*RIGIDBODY",
                                                "*KINEMATICCOUPLING"};
  return std::find(std::begin(kParts), std::end(kParts), name) != std::end(kParts);
}

void read_inp_parts(const InpModel& model, const InpTarget& target) { InpPartReader(model, target).run(); }

}  // namespace espalier::dynamics
