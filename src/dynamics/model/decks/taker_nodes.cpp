// What nodes of a deck are in the model, and masses.
#include "dynamics/model/decks/taker.hpp"

namespace espalier::dynamics::model {

void Taker::find_roles() {
  roles_.assign(deck_.mesh.nodes.size(), NodeRole::alone);
  const auto role = [&](Index n) -> NodeRole& { return roles_[static_cast<std::size_t>(n)]; };
  for (std::size_t n = 0; n < roles_.size(); ++n)
    if (bodies_.home[n] >= 0) roles_[n] = NodeRole::element;
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
    if (roles_[static_cast<std::size_t>(n)] != NodeRole::element)
      dynamics::fail(
          c.place,
          fmt::format("the coupling holds node {}, which belongs to no element that is taken; leave it out", name(n)));
    if (!c.rigid) continue;
    if (const auto [known, fresh] = rigid_nodes_.emplace(n, number); !fresh)
      dynamics::fail(c.place,
                     fmt::format("node {} belongs to this rigid coupling and to that of line {}: it can follow one "
                                 "of them only; leave it out of the other",
                                 name(n), deck_.couplings[static_cast<std::size_t>(known->second)].place.line));
  }
  NodeRole& role = roles_[static_cast<std::size_t>(c.reference)];
  const bool thin = role == NodeRole::element && is_thin(home(c.reference));
  if (role == NodeRole::element && !(thin && c.turns))
    dynamics::fail(c.place,
                   fmt::format("the reference node {} belongs to a solid itself; give the coupling one of its own",
                               name(c.reference)));
  if (!references_.emplace(c.reference, number).second)
    dynamics::fail(c.place, fmt::format("the reference node {} is that of another coupling, too", name(c.reference)));
  if (thin) return;
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
    case NodeRole::element: {
      Value frame = m.table({{"body", m.text(home(node).name)}});
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

const DeckBody& Taker::body_with(const std::vector<Index>& nodes, const DeckPlace& place) const {
  const auto has_all = [&](int body) {
    return std::all_of(nodes.begin(), nodes.end(), [&](Index n) {
      const int own = bodies_.home[static_cast<std::size_t>(n)];
      const auto shared = bodies_.shared.find({body, own});
      return own == body || (shared != bodies_.shared.end() &&
                             std::find(shared->second.begin(), shared->second.end(), n) != shared->second.end());
    });
  };
  for (std::size_t b = 0; b < bodies_.list.size(); ++b)
    if (has_all(static_cast<int>(b))) return bodies_.list[b];
  dynamics::fail(place, fmt::format("its nodes belong to several bodies, {} and others: solids, shells of one section, "
                                    "beams; make one for each of them",
                                    home(nodes.front()).name));
}

void Taker::join_bodies() {
  for (const auto& [pair, nodes] : bodies_.shared) {
    const DeckBody &own = bodies_.list[static_cast<std::size_t>(pair.first)],
                   &to = bodies_.list[static_cast<std::size_t>(pair.second)];
    std::vector<Index> tied = nodes;
    if (own.type == "shell" && to.type == "beam") {
      // Beams along the shell turn with it by their own nodes; one that stands on it would spin about the normal.
      std::set<Index> along, of_shell;
      for (const Index e : own.elements)
        for (const Index n : deck_.mesh.element(e)) of_shell.insert(n);
      for (const Index e : to.elements) {
        const auto line = deck_.mesh.element(e);
        const auto on_shell = [&](Index n) { return of_shell.contains(n); };
        if (std::all_of(line.begin(), line.end(), on_shell)) along.insert(line.begin(), line.end());
      }
      std::erase_if(tied, [&](Index n) { return !along.contains(n); });
      for (const Index n : nodes) {
        if (along.contains(n)) continue;
        const std::string entry = fresh_name("weld");
        const ValueMaker m = maker({deck_.mesh.name, 0}, "joints", entry);
        Value a = m.table({{"body", m.text(own.name)}}), b = m.table({{"body", m.text(to.name)}});
        name_node(m, n, a);
        name_node(m, n, b);
        add("joints", entry, m.table({{"type", m.text("fixed")}, {"a", std::move(a)}, {"b", std::move(b)}}));
      }
    }
    if (tied.empty()) continue;
    const std::string entry = fresh_name("seam");
    const ValueMaker m = maker({deck_.mesh.name, 0}, "ties", entry);
    Point low = at(tied.front()), high = low;
    for (const Point& p : deck_.mesh.nodes)
      for (std::size_t d = 0; d < 3; ++d) {
        low[d] = std::min(low[d], p[d]);
        high[d] = std::max(high[d], p[d]);
      }
    const double size = high[0] - low[0] + high[1] - low[1] + high[2] - low[2];
    add("ties", entry,
        m.table({{"body", m.text(own.name)},
                 {"nodes", m.text(node_set("deck-" + entry, tied))},
                 {"to", m.table({{"body", m.text(to.name)}})},
                 {"tolerance", m.number(size)}}));  // they are one node in the deck, with offsets beside it
  }
}

void Taker::masses() {
  for (const DeckMass& mass : deck_.masses) {
    const bool turns = std::any_of(mass.inertia.begin(), mass.inertia.end(), [](double x) { return x != 0; });
    const std::string entry = fresh_name("mass");
    const ValueMaker m = maker(mass.place, "bodies", entry);
    Point place = at(mass.node);
    for (std::size_t d = 0; d < 3; ++d) place[d] += mass.offset[d];
    const bool rigid = turns || mass.offset != Point{};
    if (rigid && role(mass.node) != NodeRole::rigid_reference && !(this->turns(mass.node) && !is_reference(mass.node)))
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
