// Connectors of a deck.
#include "dynamics/model/decks/taker.hpp"

namespace espalier::dynamics::model {
Value Taker::connector_end(const ValueMaker& m, Index node, const Point& point, const std::array<Point, 3>& axes,
                           std::size_t z, std::size_t x) {
  const auto turned = [&](Value frame) {
    frame.entries.emplace_back("axis", m.vector(axes[z]));
    frame.entries.emplace_back("x_axis", m.vector(axes[x]));
    return frame;
  };
  if (node < 0 || is_ground(node)) return turned(m.table({{"body", m.text("ground")}, {"point", m.vector(point)}}));
  if (is_reference(node))
    return turned(coupling_frame(m, deck_.couplings[static_cast<std::size_t>(references_.at(node))], point));
  if (point != at(node))
    fail(m.place(), fmt::format("node {} does not turn, and the connector joins it to another place: put the "
                                "connector's nodes at one place, or on reference nodes of couplings",
                                name(node)));
  return turns(node) ? turned(frame(m, node)) : frame(m, node);
}

void Taker::connectors() {
  for (const DeckConnector& c : deck_.connectors) {
    const std::string entry = fresh_name("connector");
    const bool between = c.joint == "distance" || c.type == "AXIAL";  // along the line between the nodes
    const Point& place = at(c.b >= 0 ? c.b : c.a);
    const auto end = [&](const ValueMaker& m, bool b, std::size_t z, std::size_t x) {
      const Index node = b ? c.b : c.a;
      return connector_end(m, node, between && node >= 0 ? at(node) : place, b ? c.axes_b : c.axes_a, z, x);
    };
    if (!c.joint.empty()) {
      const ValueMaker m = maker(c.place, "joints", entry);
      // Axis 1 is that of hinges and guides; a universal joint holds axis 1 of a and axis 3 of b at right angles.
      const bool cross = c.joint == "universal";
      add("joints", entry,
          m.table({{"type", m.text(c.joint)},
                   {"a", end(m, false, cross ? 2 : 0, cross ? 0 : 1)},
                   {"b", end(m, true, 0, 1)}}));
      outputs_.push_back(entry + ".force");
    }
    connector_springs(c, entry, end);
  }
}

void Taker::connector_springs(const DeckConnector& c, const std::string& entry,
                              const std::function<Value(const ValueMaker&, bool, std::size_t, std::size_t)>& end) {
  const auto acts = [&](std::size_t k) { return c.stiffness[k] != 0 || c.damping[k] != 0; };
  const auto spring = [&](const char* type, const char* suffix, std::size_t k) {
    const ValueMaker m = maker(c.place, "forces", entry + suffix);
    add("forces", entry + suffix,
        m.table({{"type", m.text(type)},
                 {"a", end(m, false, 0, 1)},
                 {"b", end(m, true, 0, 1)},
                 {"stiffness", m.number(c.stiffness[k])},
                 {"damping", m.number(c.damping[k])},
                 {"rest", m.text("initial")}}));
  };
  if (c.type == "AXIAL") {
    if (acts(0)) spring("spring", "_spring", 0);
    return;
  }
  const bool along = c.joint == "prismatic" || c.joint == "cylindrical" || c.joint == "in-line";
  const bool about =
      c.joint == "revolute" || c.joint == "cylindrical" || c.joint == "planar" || c.joint == "parallel-axes";
  if (along && acts(0)) spring("axial-spring", "_spring", 0);
  if (about && acts(3)) spring("rotational-spring", "_turn_spring", 3);
  Point linear{}, damping{}, angular{}, angular_damping{};
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(along && k == 0)) linear[k] = c.stiffness[k], damping[k] = c.damping[k];
    if (!(about && k == 0)) angular[k] = c.stiffness[3 + k], angular_damping[k] = c.damping[3 + k];
  }
  if (linear == Point{} && damping == Point{} && angular == Point{} && angular_damping == Point{}) return;
  const ValueMaker m = maker(c.place, "forces", entry + "_bushing");
  add("forces", entry + "_bushing",
      m.table({{"type", m.text("bushing")},
               {"a", end(m, false, 2, 0)},
               {"b", end(m, true, 2, 0)},
               {"stiffness", m.vector(linear)},
               {"damping", m.vector(damping)},
               {"angular_stiffness", m.vector(angular)},
               {"angular_damping", m.vector(angular_damping)}}));
}

}  // namespace espalier::dynamics::model
