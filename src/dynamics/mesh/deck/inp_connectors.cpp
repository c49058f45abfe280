// Connector elements of an .inp deck: their types as joints, their elasticity and damping.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "base/at.hpp"
#include "dynamics/mesh/deck/inp_deck.hpp"
#include "dynamics/mesh/deck/point_algebra.hpp"

namespace espalier::dynamics {
namespace {

using ConnectorAxes = std::array<Point, 3>;
constexpr ConnectorAxes kGlobalAxes = {Point{1, 0, 0}, Point{0, 1, 0}, Point{0, 0, 1}};

/// A type, or a translational and a rotational one, as Abaqus calls it; the joint that it is (empty: none holds), and
/// which components of relative motion are free, 1 to 6.
struct ConnectorType {
  const char* name;
  const char* joint;
  const char* free;
  bool small = false;  ///< the same as there for small rotations alone
};
constexpr ConnectorType kConnectorTypes[] = {{"BEAM", "fixed", ""},
                                             {"WELD", "fixed", ""},
                                             {"JOIN+ALIGN", "fixed", ""},
                                             {"JOIN", "spherical", "456"},
                                             {"HINGE", "revolute", "4"},
                                             {"JOIN+REVOLUTE", "revolute", "4"},
                                             {"UJOINT", "universal", ""},
                                             {"JOIN+UNIVERSAL", "universal", ""},
                                             {"CYLINDRICAL", "cylindrical", "14"},
                                             {"SLOT+REVOLUTE", "cylindrical", "14"},
                                             {"TRANSLATOR", "prismatic", "1"},
                                             {"SLOT+ALIGN", "prismatic", "1"},
                                             {"PLANAR", "planar", "234"},
                                             {"SLIDE-PLANE+REVOLUTE", "planar", "234"},
                                             {"LINK", "distance", ""},
                                             {"SLOT", "in-line", "1"},
                                             {"SLIDE-PLANE", "in-plane", "23"},
                                             {"REVOLUTE", "parallel-axes", "4"},
                                             {"AXIAL", "", "1"},
                                             {"CARTESIAN", "", "123"},
                                             {"CARTESIAN+ROTATION", "", "123456"},
                                             {"CARTESIAN+CARDAN", "", "123456", true},
                                             {"BUSHING", "", "123456", true}};

struct ConnectorBehavior {
  std::array<double, 6> stiffness{}, damping{};
  std::vector<std::pair<std::string, DeckPlace>> left;  // what of it cannot be taken
};

class InpConnectorReader {
 public:
  InpConnectorReader(const InpModel& model, const InpTarget& target, int step)
      : model_(model), target_(target), step_(step) {}

  void run() {
    for (const InpCard& card : model_.cards) {
      if (card.keyword.name == "*ORIENTATION") orientations_[upper(card.keyword.get("NAME"))] = &card;
      if (card.keyword.name.starts_with("*CONNECTOR") && card.step <= step_) behavior(card);
    }
    for (const InpCard& card : model_.cards)
      if (card.keyword.name == "*CONNECTORSECTION") section(card);
    for (const InpCard& card : model_.cards) {
      if (card.keyword.name != "*ELEMENT" || !is_connector(card)) continue;
      for (std::size_t l = 0; l < card.lines.size(); ++l)
        if (!stated_.contains({&card, l}))
          target_.leave(DeckKind::connectors, "elements CONN3D2 without *CONNECTOR SECTION", card.fields(l).place());
    }
  }

 private:
  static bool is_connector(const InpCard& card) { return upper(card.keyword.get("TYPE")) == "CONN3D2"; }
  void leave(const std::string& what, const DeckPlace& place) { target_.leave(DeckKind::connectors, what, place); }

  ConnectorAxes orientation(const InpCard& card) {
    const std::string system = upper(card.keyword.get("SYSTEM")), by = upper(card.keyword.get("DEFINITION"));
    if ((!system.empty() && system != "RECTANGULAR") || (!by.empty() && by != "COORDINATES")) {
      leave(fmt::format("*ORIENTATION {}={}", by.empty() ? "SYSTEM" : "DEFINITION", by.empty() ? system : by),
            card.place);
      return kGlobalAxes;
    }
    if (card.lines.empty()) fail(card.place, "*ORIENTATION needs a line of six numbers");
    const CardFields f = card.fields(0);
    Point a{}, b{}, c{};
    for (std::size_t d = 0; d < 3; ++d) {
      a[d] = f.real(d, "a", 0);
      b[d] = f.real(3 + d, "b", 0);
      c[d] = f.real(6 + d, "c", 0);
    }
    const Point x = direction_of(difference_of(a, c)), z = direction_of(cross_product(x, difference_of(b, c)));
    if (z == Point{}) fail(card.place, "*ORIENTATION: its points make no axes");
    ConnectorAxes axes = {x, cross_product(z, x), z};
    if (card.lines.size() > 1) turn(card.fields(1), axes);
    return axes;
  }

  /// About one of the axes, by degrees.
  static void turn(const CardFields& f, ConnectorAxes& axes) {
    const std::int64_t about = f.integer(0, "axis", 1);
    const double angle = f.real(1, "angle", 0) * std::numbers::pi / 180;
    if (about < 1 || about > 3) fail(f.place(), fmt::format("*ORIENTATION: axis {}; they are 1 to 3", about));
    const auto k = at(about - 1), i = (k + 1) % 3, j = (k + 2) % 3;
    const Point p = axes[i], q = axes[j];
    for (std::size_t d = 0; d < 3; ++d) {
      axes[i][d] = std::cos(angle) * p[d] + std::sin(angle) * q[d];
      axes[j][d] = std::cos(angle) * q[d] - std::sin(angle) * p[d];
    }
  }

  /// *CONNECTOR BEHAVIOR and what follows it.
  void behavior(const InpCard& card) {
    const std::string& name = card.keyword.name;
    if (name == "*CONNECTORSECTION") return;
    if (name == "*CONNECTORMOTION" || name == "*CONNECTORLOAD") return leave(name, card.place);
    if (name == "*CONNECTORBEHAVIOR") {
      open_ = &behaviors_[upper(card.keyword.need(LineReader(card.place.file, ""), "NAME"))];
      for (const auto& [key, value] : card.keyword.parameters)
        if (key != "NAME") open_->left.emplace_back(fmt::format("{} {}", name, key), card.place);
      return;
    }
    if (open_ == nullptr) fail(card.place, fmt::format("{} stands without a *CONNECTOR BEHAVIOR before it", name));
    const bool elastic = name == "*CONNECTORELASTICITY";
    if (!elastic && name != "*CONNECTORDAMPING") return void(open_->left.emplace_back(name, card.place));
    for (const auto& [key, value] : card.keyword.parameters)
      if (key != "COMPONENT" && !(key == "NONLINEAR" && upper(value) == "NO"))
        return void(open_->left.emplace_back(fmt::format("{} {}", name, key), card.place));
    if (!card.keyword.has("COMPONENT"))
      return void(open_->left.emplace_back(fmt::format("{} without COMPONENT", name), card.place));
    const std::int64_t component = CardFields(card.place, card.keyword.get("COMPONENT")).integer(0, "COMPONENT");
    if (component < 1 || component > 6)
      fail(card.place, fmt::format("{}: component {}; they are 1 to 6", name, component));
    if (card.lines.empty()) fail(card.place, fmt::format("{} has no value", name));
    if (card.lines.size() > 1)
      return void(open_->left.emplace_back(fmt::format("{} with several lines", name), card.place));
    const double value = card.fields(0).real(0, elastic ? "stiffness" : "damping");
    (elastic ? open_->stiffness : open_->damping)[at(component - 1)] = value;
  }

  ConnectorAxes axes_of(const InpCard& card, const std::string& name) {
    if (name.empty()) return kGlobalAxes;
    const auto found = orientations_.find(upper(name));
    if (found == orientations_.end())
      fail(card.place, fmt::format("*CONNECTOR SECTION: there is no *ORIENTATION '{}'", name));
    return orientation(*found->second);
  }

  static std::string type_of(const InpCard& card) {
    if (card.lines.empty()) fail(card.place, "*CONNECTOR SECTION needs a line with the type");
    const CardFields f = card.fields(0);
    const std::string first = upper(f.text(0)), second = upper(f.text(1));
    return second.empty() ? first : first.empty() ? second : first + "+" + second;
  }

  void section(const InpCard& card) {
    const std::string type = type_of(card);
    const auto known = std::find_if(std::begin(kConnectorTypes), std::end(kConnectorTypes),
                                    [&](const auto& t) { return type == t.name; });
    DeckConnector out;
    out.type = type;
    if (known == std::end(kConnectorTypes)) leave(fmt::format("*CONNECTOR SECTION {}", type), card.place);
    const DeckStep& step = target_.deck().step;
    if (known != std::end(kConnectorTypes) && known->small && (step.large || step.kind == DeckStep::Kind::motion))
      leave(fmt::format("*CONNECTOR SECTION {} in a step with large rotations", type), card.place);
    if (known != std::end(kConnectorTypes)) {
      out.joint = known->joint;
      out.free = known->free;
    }
    const ConnectorBehavior* behavior = behavior_of(card);
    for (const auto& [what, place] : behavior->left) leave(what, place);
    out.stiffness = behavior->stiffness;
    out.damping = behavior->damping;
    for (std::size_t k = 0; k < 6; ++k)
      if ((out.stiffness[k] != 0 || out.damping[k] != 0) && known != std::end(kConnectorTypes) &&
          out.free.find(static_cast<char>('1' + k)) == std::string::npos)
        leave(fmt::format("*CONNECTOR ELASTICITY or DAMPING of component {} of {}", k + 1, type), card.place);
    const CardFields names = card.lines.size() > 1 ? card.fields(1) : CardFields(card.place, "");
    out.axes_a = axes_of(card, names.text(0));
    out.axes_b = names.has(1) ? axes_of(card, names.text(1)) : out.axes_a;
    elements(card, out);
  }

  const ConnectorBehavior* behavior_of(const InpCard& card) {
    static const ConnectorBehavior none;
    if (!card.keyword.has("BEHAVIOR")) return &none;
    const std::string name = card.keyword.get("BEHAVIOR");
    const auto found = behaviors_.find(upper(name));
    if (found == behaviors_.end())
      fail(card.place, fmt::format("*CONNECTOR SECTION: there is no *CONNECTOR BEHAVIOR '{}'", name));
    return &found->second;
  }

  /// One connector for each element of the section's set.
  void elements(const InpCard& section, DeckConnector out) {
    const std::string set = upper(section.keyword.need(LineReader(section.place.file, ""), "ELSET"));
    const std::vector<std::string> homes = target_.lookup().homes(section.scope);
    for (const InpCard& card : model_.cards) {
      if (card.keyword.name != "*ELEMENT" || !is_connector(card)) continue;
      for (std::size_t l = 0; l < card.lines.size(); ++l) {
        const CardFields f = card.fields(l);
        const std::int64_t label = f.integer(0, "element number");
        const bool ours = upper(card.keyword.get("ELSET")) == set ||
                          std::any_of(homes.begin(), homes.end(), [&](const std::string& home) {
                            return target_.lookup().in_element_set(label, set, home);
                          });
        if (!ours) continue;
        stated_.insert({&card, l});
        out.place = f.place();
        out.a = f.has(1) ? target_.node(card, f, 1) : -1;
        out.b = f.has(2) ? target_.node(card, f, 2) : -1;
        if (out.a < 0 && out.b < 0) fail(f.place(), fmt::format("connector {} has no node", label));
        target_.deck().connectors.push_back(out);
      }
    }
  }

  const InpModel& model_;
  const InpTarget& target_;
  int step_;  // the one that is taken
  std::map<std::string, const InpCard*> orientations_;
  std::map<std::string, ConnectorBehavior> behaviors_;
  ConnectorBehavior* open_ = nullptr;
  std::set<std::pair<const InpCard*, std::size_t>> stated_;  // lines of elements
};

}  // namespace

void read_inp_connectors(const InpModel& model, const InpTarget& target, int step) {
  InpConnectorReader(model, target, step).run();
}

}  // namespace espalier::dynamics
