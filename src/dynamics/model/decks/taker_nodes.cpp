// What nodes of a deck are in the model, and masses.
#include "dynamics/model/decks/taker.hpp"

namespace espalier::dynamics::model {

void Taker::find_roles() {
  roles_.assign(deck_.mesh.nodes.size(), NodeRole::alone);
  const auto role = [&](Index n) -> NodeRole& { return roles_[static_cast<std::size_t>(n)]; };
  for (Index e = 0; e < deck_.mesh.element_count(); ++e)
    if (shape_of(deck_.mesh.type(e)).dimension == 3)
      for (const Index n : deck_.mesh.element(e)) role(n) = NodeRole::solid;
  std::set<std::int64_t> labels;
  for (const std::int64_t label : deck_.mesh.node_labels)
    if (!labels.insert(label).second) unique_labels_ = false;  // of several instances
  if (choice_.takes(DeckKind::couplings))
    for (std::size_t k = 0; k < deck_.couplings.size(); ++k) find_roles_of(deck_.couplings[k], static_cast<int>(k));
  if (choice_.takes(DeckKind::masses))
    for (const DeckMass& m : deck_.masses)
      if (role(m.node) == NodeRole::alone) role(m.node) = NodeRole::mass;
  // Nodes of no body that are held in all directions are the ground.
  std::map<Index, int> held;
  for (const DeckHold& h : deck_.holds)
    if (role(h.node) == NodeRole::alone && h.direction < 3 && h.value == 0 && ++held[h.node] == 3)
      grounded_.insert(h.node);
}

void Taker::find_roles_of(const DeckCoupling& c, int number) {
  for (const Index n : c.nodes) {
    if (roles_[static_cast<std::size_t>(n)] != NodeRole::solid)
      dynamics::fail(c.place,
                     fmt::format("the coupling holds node {}, which belongs to no solid; leave it out", name(n)));
    if (!c.rigid) continue;
    if (const auto [known, fresh] = rigid_nodes_.emplace(n, number); !fresh)
      dynamics::fail(c.place,
                     fmt::format("node {} belongs to this rigid coupling and to that of line {}: it can follow one "
                                 "of them only; leave it out of the other",
                                 name(n), deck_.couplings[static_cast<std::size_t>(known->second)].place.line));
  }
  NodeRole& role = roles_[static_cast<std::size_t>(c.reference)];
  if (role == NodeRole::solid)
    dynamics::fail(c.place,
                   fmt::format("the reference node {} belongs to a solid itself; give the coupling one of its own",
                               name(c.reference)));
  if (!references_.emplace(c.reference, number).second)
    dynamics::fail(c.place, fmt::format("the reference node {} is that of another coupling, too", name(c.reference)));
  role = c.rigid ? NodeRole::rigid_reference : c.turns ? NodeRole::mean_reference : NodeRole::mean_place;
}

ValueMaker Taker::maker(const DeckPlace& place, const std::string& section, const std::string& entry) const {
  return {place, section + "." + entry};
}

void Taker::add(const char* section, const std::string& entry, Value value) {
  out_.entries.push_back({section, entry, std::move(value)});
}

std::string Taker::node_set(std::string set, const std::vector<Index>& nodes) {
  out_.node_sets[set] = nodes;
  return set;
}

void Taker::name_node(const ValueMaker& m, Index node, Value& table) {
  const std::int64_t label = deck_.mesh.node_label(node);
  constexpr std::int64_t kMost = 2'000'000'000;
  if (unique_labels_ && label >= 0 && label <= kMost)
    table.entries.emplace_back("node", m.whole(label));
  else
    table.entries.emplace_back("nodes", m.text(node_set(fmt::format("deck-node-{}", node), {node})));
}

std::string Taker::coupling_name(Index reference) const {
  return fmt::format("{}_coupling_{}", body_, references_.at(reference) + 1);
}

Value Taker::frame(const ValueMaker& m, Index node) {
  switch (role(node)) {
    case NodeRole::solid: {
      Value frame = m.table({{"body", m.text(body_)}});
      name_node(m, node, frame);
      return frame;
    }
    case NodeRole::rigid_reference:
    case NodeRole::mean_reference:
    case NodeRole::mean_place:
      return m.text(coupling_name(node));
    case NodeRole::mass:
      return m.text(mass_bodies_.at(node));
    case NodeRole::alone:
      break;
  }
  if (!grounded_.contains(node)) refuse_alone(m, node);
  return m.table({{"body", m.text("ground")}, {"point", m.vector(at(node))}});
}

void Taker::refuse_alone(const ValueMaker& m, Index node) const {
  fail(m.place(), fmt::format("node {} belongs to no solid, has no mass and is not held in x, y and z: nothing would "
                              "keep it where it is",
                              name(node)));
}

void Taker::masses() {
  for (const DeckMass& mass : deck_.masses) {
    const bool turns = std::any_of(mass.inertia.begin(), mass.inertia.end(), [](double x) { return x != 0; });
    const std::string entry = fresh_name("mass");
    const ValueMaker m = maker(mass.place, "bodies", entry);
    Point place = at(mass.node);
    for (std::size_t d = 0; d < 3; ++d) place[d] += mass.offset[d];
    const bool rigid = turns || mass.offset != Point{};
    if (rigid && role(mass.node) != NodeRole::rigid_reference)
      dynamics::fail(mass.place,
                     fmt::format("the mass of node {} has an offset or moments of inertia, and the node does not "
                                 "turn; put it on the reference node of a rigid coupling",
                                 name(mass.node)));
    Value body = m.table(
        {{"type", m.text(rigid ? "rigid" : "point")}, {"mass", m.number(mass.mass)}, {"position", m.vector(place)}});
    load_mass(mass, entry, place, body);
    if (rigid) {
      const auto& i = mass.inertia;
      body.entries.emplace_back("inertia", m.list({m.vector({i[0], i[3], i[4]}), m.vector({i[3], i[1], i[5]}),
                                                   m.vector({i[4], i[5], i[2]})}));
    }
    add("bodies", entry, std::move(body));
    if (role(mass.node) == NodeRole::mass && mass_bodies_.emplace(mass.node, entry).second) continue;
    const std::string pin = entry + "_pin";
    const ValueMaker j = maker(mass.place, "joints", pin);
    Value b = role(mass.node) == NodeRole::mass ? j.text(mass_bodies_.at(mass.node)) : frame(j, mass.node);
    add("joints", pin,
        j.table({{"type", j.text(rigid ? "fixed" : "spherical")}, {"a", j.text(entry)}, {"b", std::move(b)}}));
  }
}

void Taker::hold_place(Index node, const Held& held) {
  if (deck_.axes.contains(node) && held.any(0, 3))
    dynamics::fail((*std::find_if(held.by.begin(), held.by.end(), [](const auto* h) { return h != nullptr; }))->place,
                   fmt::format("node {}, which belongs to no solid, is held along axes of its own (*TRANSFORM, CD): "
                               "that is not taken",
                               name(node)));
  for (std::size_t d = 0; d < 3; ++d)
    if (held.by[d] != nullptr) add_prescribed(node, *held.by[d], d);
}

}  // namespace espalier::dynamics::model
