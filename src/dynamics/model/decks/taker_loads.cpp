// Loads of a deck.
#include <cmath>
#include <optional>
#include <tuple>

#include "dynamics/mesh/deck/point_algebra.hpp"
#include "dynamics/model/decks/taker.hpp"

namespace espalier::dynamics::model {

void Taker::forces() {
  if (deck_.step.kind == DeckStep::Kind::modes && choice_.takes(DeckKind::step)) return;
  std::map<std::pair<Index, int>, Load> loads;
  for (const DeckForce& f : deck_.forces) {
    const bool motion = deck_.step.kind == DeckStep::Kind::motion;
    auto [load, fresh] = loads.try_emplace({f.node, motion ? f.curve : -1});
    if (fresh) load->second.place = f.place;
    const double value = f.value * (f.curve >= 0 && !motion ? at_end(f.curve) : 1);
    Point& sum = f.direction < 3 ? load->second.force : load->second.moment;
    const auto d = static_cast<std::size_t>(f.direction % 3);
    if (const auto axes = deck_.axes.find(f.node); axes != deck_.axes.end())
      for (std::size_t k = 0; k < 3; ++k) sum[k] += value * axes->second[d][k];
    else
      sum[d] += value;
  }
  // The loads of nodes of elements: by force, curve, body.
  std::map<std::tuple<Point, int, std::string>, std::pair<std::vector<Index>, DeckPlace>> groups;
  for (const auto& [key, load] : loads) {
    const auto& [node, curve] = key;
    if (role(node) == NodeRole::alone) {
      if (grounded_.contains(node)) continue;  // the ground bears it
      dynamics::fail(load.place, fmt::format("the load acts on node {}, which belongs to no element, mass or coupling",
                                             name(node)));
    }
    if (load.moment != Point{} && !turns(node))
      dynamics::fail(load.place,
                     fmt::format("a moment acts on node {}, which does not turn; put it on the reference node of a "
                                 "coupling",
                                 name(node)));
    if (role(node) == NodeRole::element && load.moment == Point{}) {
      auto& group = groups[{load.force, curve, home(node).name}];
      if (group.first.empty()) group.second = load.place;
      group.first.push_back(node);
    } else {
      add_load(load, curve, node);
    }
  }
  for (const auto& [key, group] : groups) {
    const std::string entry = fresh_name("force");
    const ValueMaker m = maker(group.second, "forces", entry);
    const auto& [force, curve, body] = key;
    Point sum = force;
    for (double& x : sum) x *= static_cast<double>(group.first.size());  // the frame spreads it evenly
    Value a = m.table({{"body", m.text(body)}});
    if (group.first.size() == 1)
      name_node(m, group.first.front(), a);
    else
      a.entries.emplace_back("nodes", m.text(node_set("deck-" + entry, group.first)));
    add_force(m, entry, std::move(a), sum, Point{}, curve);
  }
}

void Taker::add_load(const Load& load, int curve, Index node) {
  const std::string entry = fresh_name("force");
  const ValueMaker m = maker(load.place, "forces", entry);
  add_force(m, entry, frame(m, node), load.force, load.moment, curve);
}

void Taker::add_force(const ValueMaker& m, const std::string& entry, Value a, const Point& force, const Point& moment,
                      int curve) {
  Value load = m.table({{"type", m.text("load")}, {"a", std::move(a)}, {"force", m.vector(force)}});
  if (moment != Point{}) load.entries.emplace_back("moment", m.vector(moment));
  if (curve >= 0) load.entries.emplace_back("factor", m.text(spline(curve) + "(t)"));
  add("forces", entry, std::move(load));
}

void Taker::pressures() {
  if (deck_.step.kind == DeckStep::Kind::modes && choice_.takes(DeckKind::step)) return;
  const bool motion = deck_.step.kind == DeckStep::Kind::motion;
  std::map<std::tuple<int, double, int>, std::pair<std::vector<MeshFace>, DeckPlace>> groups;
  for (const DeckPressure& p : deck_.pressures) {
    const auto e = static_cast<std::size_t>(p.face.element);
    const int body = bodies_.of_element[e];
    if (body < 0) dynamics::fail(p.place, "the pressure acts on elements that are not taken");
    double value = p.value * (p.curve >= 0 && !motion ? at_end(p.curve) : 1);
    // Shells are pressed from the top of ours, whose normal may be turned.
    if (bodies_.list[static_cast<std::size_t>(body)].type == "shell" &&
        (p.face.face == kShellBottom) != (bodies_.turned[e] != 0))
      value = -value;
    auto& group = groups[{body, value, motion ? p.curve : -1}];
    if (group.first.empty()) group.second = p.place;
    group.first.push_back(p.face);
  }
  for (const auto& [key, group] : groups) {
    const auto& [body, value, curve] = key;
    const DeckBody& on = bodies_.list[static_cast<std::size_t>(body)];
    const std::string entry = fresh_name("pressure");
    const ValueMaker m = maker(group.second, "forces", entry);
    std::string face = "deck-" + entry;
    if (on.type == "shell") {
      for (const MeshFace& f : group.first) out_.element_sets[face].push_back(f.element);
      face += " middle";
    } else {
      out_.face_sets[face] = group.first;
    }
    add("forces", entry,
        m.table({{"type", m.text("pressure")},
                 {"body", m.text(on.name)},
                 {"face", m.text(face)},
                 {"pressure", curve >= 0 ? m.text(fmt::format("{}*{}(t)", value, spline(curve))) : m.number(value)}}));
  }
}

void Taker::line_loads() {
  if (deck_.step.kind == DeckStep::Kind::modes && choice_.takes(DeckKind::step)) return;
  const bool motion = deck_.step.kind == DeckStep::Kind::motion;
  std::map<std::tuple<int, bool, Point, int>, std::pair<std::vector<Index>, DeckPlace>> groups;
  for (const DeckLineLoad& l : deck_.line_loads) {
    const int body = bodies_.of_element[static_cast<std::size_t>(l.element)];
    if (body < 0) dynamics::fail(l.place, "the load acts on elements that are not taken");
    const bool edge = l.edge >= 0;
    const Point force = scaled_by(l.curve >= 0 && !motion ? at_end(l.curve) : 1, l.force);
    auto& group = groups[{body, edge, force, motion ? l.curve : -1}];
    if (group.first.empty()) group.second = l.place;
    if (!edge) {
      group.first.push_back(l.element);
      continue;
    }
    const auto nodes = deck_.mesh.element(l.element);
    const auto corners = static_cast<std::size_t>(shape_of(deck_.mesh.type(l.element)).corners),
               a = static_cast<std::size_t>(l.edge);
    group.first.insert(group.first.end(), {nodes[a], nodes[(a + 1) % corners]});
    if (nodes.size() > corners) group.first.push_back(nodes[corners + a]);
  }
  for (auto& [key, group] : groups) {
    const auto& [body, edge, force, curve] = key;
    const std::string entry = fresh_name("line_load");
    const ValueMaker m = maker(group.second, "forces", entry);
    Value load =
        m.table({{"type", m.text("line-load")}, {"body", m.text(bodies_.list[static_cast<std::size_t>(body)].name)}});
    sort_unique(group.first);
    load.entries.emplace_back(edge ? "nodes" : "element_set", m.text("deck-" + entry));
    (edge ? out_.node_sets : out_.element_sets)["deck-" + entry] = group.first;
    load.entries.emplace_back("force", m.vector(force));
    if (curve >= 0) load.entries.emplace_back("factor", m.text(spline(curve) + "(t)"));
    add("forces", entry, std::move(load));
  }
}

bool Taker::acts(const DeckBodyLoad& load) const {
  return choice_.takes(load.label == "GRAV" ? DeckKind::gravity : DeckKind::dload) &&
         !(deck_.step.kind == DeckStep::Kind::modes && choice_.takes(DeckKind::step));
}

double Taker::factor_of(const DeckBodyLoad& load) const {
  return load.curve >= 0 && deck_.step.kind != DeckStep::Kind::motion ? at_end(load.curve) : 1;
}

void Taker::body_loads() {
  for (const DeckBody& body : bodies_.list) body_loads_of(body);
}

void Taker::body_loads_of(const DeckBody& body) {
  const std::vector<Index>& own = body.elements;
  const bool motion = deck_.step.kind == DeckStep::Kind::motion;
  // What weighs all elements alike is the gravity of the body.
  std::optional<Point> weight;
  bool alike = true;
  std::map<Index, const DeckBodyLoad*> spins;
  for (const DeckBodyLoad& load : deck_.body_loads) {
    if (!acts(load)) continue;
    if (load.label == "CENTRIF")
      for (const Index e : load.set.empty() ? own : load.elements)
        if (const auto [known, fresh] = spins.emplace(e, &load); !fresh)
          dynamics::fail(load.place, fmt::format("element {} turns by this CENTRIF and by that of line {}",
                                                 element_name(deck_.mesh, e), known->second->place.line));
    if (load.label != "GRAV") continue;
    const auto is_own = [&](Index e) { return std::binary_search(own.begin(), own.end(), e); };
    const bool all =
        load.set.empty() || std::includes(load.elements.begin(), load.elements.end(), own.begin(), own.end());
    const bool none = !load.set.empty() && std::none_of(load.elements.begin(), load.elements.end(), is_own);
    alike = alike && (all || none) && !(motion && load.curve >= 0);
    if (none) continue;
    if (!weight) weight = Point{};
    for (std::size_t d = 0; d < 3; ++d) (*weight)[d] += factor_of(load) * load.acceleration[d];
  }
  for (const DeckBodyLoad& load : deck_.body_loads)
    if (acts(load) && !(alike && load.label == "GRAV")) add_body_load(load, body);
  if (!weight || !alike) return;
  const ValueMaker m(deck_.body_loads.front().place, fmt::format("bodies.{}.gravity", body.name));
  body_keys_[body.name].emplace_back("gravity", m.vector(*weight));
}

void Taker::add_body_load(const DeckBodyLoad& load, const DeckBody& body) {
  std::vector<Index> elements = load.elements;
  std::erase_if(elements, [&](Index e) { return !std::binary_search(body.elements.begin(), body.elements.end(), e); });
  if (!load.set.empty() && elements.empty()) return;
  const bool solid = body.type == "solid", whole = load.set.empty() || (!solid && elements == body.elements);
  if (!solid && (!whole || load.per_volume != Point{}))
    dynamics::fail(load.place,
                   fmt::format("*DLOAD {} acts on {}, which is no solid: there gravity and centrifugal forces act on "
                               "all elements of one section or kind; give the others a section of their own, or take "
                               "forces per area and length",
                               load.label, whole ? body.name : "some elements of " + body.name));
  const std::string entry = fresh_name("body_load");
  const ValueMaker m = maker(load.place, "forces", entry);
  Value value = m.table({{"type", m.text("load")}, {"body", m.text(body.name)}});
  if (!whole) {
    out_.element_sets["deck-" + entry] = elements;
    value.entries.emplace_back("element_set", m.text("deck-" + entry));
  }
  const double factor = factor_of(load);
  const auto scaled = [&](double by, Point x) {
    for (double& component : x) component *= by;
    return m.vector(x);
  };
  if (load.acceleration != Point{}) value.entries.emplace_back("acceleration", scaled(factor, load.acceleration));
  if (load.per_volume != Point{}) value.entries.emplace_back("force_density", scaled(factor, load.per_volume));
  if (load.label == "CENTRIF") {
    if (factor < 0) dynamics::fail(load.place, "the AMPLITUDE of a CENTRIF is negative at the end of the step");
    value.entries.emplace_back("angular_velocity", scaled(std::sqrt(factor), load.spin));
    value.entries.emplace_back("point", m.vector(load.point));
  } else if (load.acceleration == Point{} && load.per_volume == Point{}) {
    return;
  }
  if (load.curve >= 0 && deck_.step.kind == DeckStep::Kind::motion)
    value.entries.emplace_back("factor", m.text(spline(load.curve) + "(t)"));
  add("forces", entry, std::move(value));
}

void Taker::load_mass(const DeckMass& mass, const std::string& entry, const Point& place, Value& body) {
  Point weight{}, force{};
  for (const std::size_t k : mass.loads) {
    const DeckBodyLoad& load = deck_.body_loads[k];
    if (!acts(load)) continue;
    if (load.curve >= 0 && deck_.step.kind == DeckStep::Kind::motion)
      dynamics::fail(
          load.place,
          fmt::format("the AMPLITUDE of this load on the mass of node {} is not taken in a motion", name(mass.node)));
    for (std::size_t d = 0; d < 3; ++d) weight[d] += factor_of(load) * load.acceleration[d];
    if (load.label != "CENTRIF") continue;
    const bool turns = std::any_of(mass.inertia.begin(), mass.inertia.end(), [](double x) { return x != 0; });
    if (turns || deck_.step.large || deck_.step.kind == DeckStep::Kind::motion)
      dynamics::fail(load.place,
                     fmt::format("CENTRIF acts on the mass of node {}: that is taken in linear statics, of masses "
                                 "without moments of inertia",
                                 name(mass.node)));
    double along = 0, square = 0;
    for (std::size_t d = 0; d < 3; ++d) {
      along += load.spin[d] * (place[d] - load.point[d]);
      square += load.spin[d] * load.spin[d];
    }
    for (std::size_t d = 0; d < 3; ++d)
      force[d] += factor_of(load) * mass.mass * (square * (place[d] - load.point[d]) - along * load.spin[d]);
  }
  const ValueMaker m = maker(mass.place, "forces", entry + "_load");
  if (weight != Point{}) body.entries.emplace_back("gravity", m.vector(weight));
  if (force != Point{}) add_force(m, entry + "_load", m.text(entry), force, Point{}, -1);
}

}  // namespace espalier::dynamics::model
