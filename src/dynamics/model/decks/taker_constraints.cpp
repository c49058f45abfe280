// Springs, equations, ties and couplings of a deck.
#include <limits>

#include "dynamics/mesh/deck/point_algebra.hpp"
#include "dynamics/model/decks/taker.hpp"

namespace espalier::dynamics::model {

void Taker::springs(const std::vector<DeckSpring>& list, const char* what) {
  for (const DeckSpring& s : list) {
    const std::string entry = fresh_name(what);
    if (s.direction >= 0 && s.b >= 0 && !is_ground(s.a) && !is_ground(s.b)) {
      spring_between(s, entry);
      continue;
    }
    const ValueMaker m = maker(s.place, "forces", entry);
    if (s.direction < 0) {
      if (at(s.a) == at(s.b))
        dynamics::fail(s.place,
                       fmt::format("the spring along the line between nodes {} and {} has no direction: they lie at "
                                   "the same place",
                                   name(s.a), name(s.b)));
      add("forces", entry,
          m.table({{"type", m.text("spring")},
                   {"a", frame(m, s.a)},
                   {"b", frame(m, s.b)},
                   {"stiffness", m.number(s.stiffness)},
                   {"damping", m.number(s.damping)},
                   {"rest", m.text("initial")}}));
      continue;
    }
    const Index node = s.b >= 0 && is_ground(s.a) ? s.b : s.a;
    if (is_ground(node)) continue;
    if (s.direction >= 3 && !turns(node))
      dynamics::fail(s.place, fmt::format("a spring acts on the rotation of node {}, which does not turn", name(node)));
    Point linear{}, angular{}, damping{}, angular_damping{};
    const auto d = static_cast<std::size_t>(s.direction % 3);
    (s.direction < 3 ? linear : angular)[d] = s.stiffness;
    (s.direction < 3 ? damping : angular_damping)[d] = s.damping;
    add("forces", entry,
        m.table({{"type", m.text("bushing")},
                 {"a", m.table({{"body", m.text("ground")}, {"point", m.vector(at(node))}})},
                 {"b", frame(m, node)},
                 {"stiffness", m.vector(linear)},
                 {"damping", m.vector(damping)},
                 {"angular_stiffness", m.vector(angular)},
                 {"angular_damping", m.vector(angular_damping)}}));
  }
}

void Taker::spring_between(const DeckSpring& s, const std::string& entry) {
  if (role(s.a) != NodeRole::element || role(s.b) != NodeRole::element || s.direction > 2)
    dynamics::fail(s.place,
                   fmt::format("the spring {} {} between nodes {} and {} is not taken: such springs are along x, y, z, "
                               "between nodes of elements; springs along the line between two nodes are (SPRINGA)",
                               s.direction > 2 ? "about" : "along", "xyz"[s.direction % 3], name(s.a), name(s.b)));
  const ValueMaker m = maker(s.place, "equations", entry);
  Value equation = terms(m, {{s.a, s.direction, -1}, {s.b, s.direction, 1}});
  if (s.stiffness != 0) equation.entries.emplace_back("stiffness", m.number(s.stiffness));
  if (s.damping != 0) equation.entries.emplace_back("damping", m.number(s.damping));
  add("equations", entry, std::move(equation));
}

Value Taker::terms(const ValueMaker& m, const std::vector<DeckEquation::Term>& list) {
  std::vector<Value> items;
  for (const DeckEquation::Term& t : list) {
    Value item = m.table({});
    if (home(t.node).name != body_) item.entries.emplace_back("body", m.text(home(t.node).name));
    name_node(m, t.node, item);
    item.entries.emplace_back("direction", m.text(std::string(1, "xyz"[t.direction])));
    item.entries.emplace_back("factor", m.number(t.factor));
    items.push_back(std::move(item));
  }
  return m.table({{"body", m.text(body_)}, {"terms", m.list(std::move(items))}});
}

void Taker::equations() {
  std::set<std::pair<Index, int>> held, dependent;
  for (const DeckHold& h : deck_.holds) held.emplace(h.node, h.direction);
  for (const DeckEquation& e : deck_.equations) {
    std::vector<DeckEquation::Term> list;
    for (const DeckEquation::Term& t : e.terms) {
      if (t.factor == 0 && &t == e.terms.data())
        dynamics::fail(
            e.place,
            fmt::format("the first factor of the equation is 0: its node {} is the one that follows the others; "
                        "give another one first",
                        name(t.node)));
      if (t.factor == 0) continue;
      if (role(t.node) == NodeRole::alone && grounded_.contains(t.node)) continue;
      if (role(t.node) != NodeRole::element || t.direction > 2)
        dynamics::fail(
            e.place,
            fmt::format("the equation has {} of node {}{}; equations of displacements of nodes of elements are "
                        "taken",
                        t.direction > 2 ? "a rotation" : "a displacement", name(t.node),
                        role(t.node) == NodeRole::element ? "" : ", which belongs to no element"));
      if (deck_.axes.contains(t.node))
        dynamics::fail(
            e.place, fmt::format("the equation has node {}, which has axes of its own (*TRANSFORM): that is not taken",
                                 name(t.node)));
      list.push_back(t);
    }
    const std::pair first(list.empty() ? -1 : list.front().node, list.empty() ? 0 : list.front().direction);
    if (list.empty()) continue;
    if (choice_.takes(DeckKind::boundary) && held.contains(first))
      dynamics::fail(
          e.place, fmt::format("node {} follows others by this equation, and is held along {}; put a term that is free "
                               "first, or take the support out",
                               name(first.first), "xyz"[first.second]));
    if (!dependent.insert(first).second)
      dynamics::fail(
          e.place,
          fmt::format("node {} follows others along {} by an equation before this one already; put another term "
                      "first",
                      name(first.first), "xyz"[first.second]));
    if (rigid_nodes_.contains(first.first))
      dynamics::fail(e.place, fmt::format("node {} follows others by this equation and belongs to a rigid coupling",
                                          name(first.first)));
    const std::string entry = fresh_name("equation");
    const ValueMaker m = maker(e.place, "equations", entry);
    add("equations", entry, terms(m, list));
  }
}

void Taker::ties() {
  const auto body_of = [&](const MeshFace& f) { return bodies_.of_element[static_cast<std::size_t>(f.element)]; };
  for (const DeckTie& t : deck_.ties) {
    std::map<int, std::vector<MeshFace>> faces;  // by the body that they belong to
    for (const MeshFace& f : t.faces)
      if (body_of(f) >= 0) faces[body_of(f)].push_back(f);
    // Each node to the body whose faces are nearest: as told by their corners, where there are several.
    const auto distance = [&](Index node, const std::vector<MeshFace>& to) {
      double least = std::numeric_limits<double>::infinity();
      for (const MeshFace& f : to)
        for (const Index n : deck_.mesh.element(f.element)) {
          const Point d = difference_of(at(n), at(node));
          least = std::min(least, dot_product(d, d));
        }
      return least;
    };
    std::map<std::pair<int, int>, std::vector<Index>> groups;
    for (const Index n : t.nodes) {
      if (role(n) != NodeRole::element)
        dynamics::fail(t.place, fmt::format("*TIE: node {} belongs to no element that is taken", name(n)));
      int to = faces.empty() ? -1 : faces.begin()->first;
      for (const auto& [body, list] : faces)
        if (faces.size() > 1 && distance(n, list) < distance(n, faces.at(to))) to = body;
      groups[{bodies_.home[static_cast<std::size_t>(n)], to}].push_back(n);
    }
    for (const auto& [pair, nodes] : groups) {
      if (pair.second < 0) dynamics::fail(t.place, "*TIE: its faces belong to no element that is taken");
      const std::string entry = fresh_name("tie");
      const ValueMaker m = maker(t.place, "ties", entry);
      const DeckBody& to = bodies_.list[static_cast<std::size_t>(pair.second)];
      Value target = m.table({{"body", m.text(to.name)}});
      if (to.type == "solid") {
        out_.face_sets["deck-" + entry] = faces.at(pair.second);
        target.entries.emplace_back("face", m.text("deck-" + entry));
      }
      Value tie = m.table({{"body", m.text(bodies_.list[static_cast<std::size_t>(pair.first)].name)},
                           {"nodes", m.text(node_set("deck-" + entry, nodes))},
                           {"to", std::move(target)}});
      if (t.tolerance > 0) tie.entries.emplace_back("tolerance", m.number(t.tolerance));
      add("ties", entry, std::move(tie));
    }
  }
}

Value Taker::coupling_frame(const ValueMaker& m, const DeckCoupling& c, const Point& point) {
  const DeckBody& body = body_with(c.nodes, c.place);
  const bool of_shells = std::any_of(c.faces.begin(), c.faces.end(), [&](const MeshFace& f) {
    return shape_of(deck_.mesh.type(f.element)).dimension < 3;
  });
  if (!c.rigid && of_shells)
    dynamics::fail(c.place, "a distributing coupling of a surface of shells is not taken: give it a surface of nodes");
  Value frame = m.table({{"body", m.text(body.name)}});
  if (c.weights.empty()) {
    frame.entries.emplace_back("nodes", m.text(node_set("deck-" + coupling_name(c.reference), c.nodes)));
  } else {
    if (!unique_labels_)
      dynamics::fail(c.place,
                     "the coupling has nodes of different weights, and nodes of several instances have the same "
                     "numbers: number them apart, or give all the same weight");
    std::vector<Value> labels, weights;
    for (const Index n : c.nodes) labels.push_back(m.whole(deck_.mesh.node_label(n)));
    for (const double w : c.weights) weights.push_back(m.number(w));
    frame.entries.emplace_back("nodes", m.list(std::move(labels)));
    frame.entries.emplace_back("weights", m.list(std::move(weights)));
  }
  if (!c.turns) return frame;  // the mean of places
  frame.entries.emplace_back("attach", m.text(c.rigid ? "rigid" : "mean"));
  frame.entries.emplace_back("point", m.vector(point));
  frame.entries.emplace_back("most_nodes", m.whole(0));
  if (!c.rigid && !c.faces.empty()) {
    out_.face_sets["deck-" + coupling_name(c.reference)] = c.faces;
    frame.entries.emplace_back("face", m.text("deck-" + coupling_name(c.reference)));
  }
  return frame;
}

void Taker::couplings() {
  for (const DeckCoupling& c : deck_.couplings) {
    const std::string entry = coupling_name(c.reference);
    const ValueMaker m = maker(c.place, "markers", entry);
    add("markers", entry, coupling_frame(m, c, at(c.reference)));
    outputs_.push_back(entry + ".position");
    if (role(c.reference) == NodeRole::element) {  // a node of a beam or shell
      const ValueMaker j = maker(c.place, "joints", entry + "_weld");
      add("joints", entry + "_weld",
          j.table({{"type", j.text("fixed")}, {"a", j.text(entry)}, {"b", frame(j, c.reference)}}));
    }
    if (!c.notice.empty()) out_.notices.push_back(fmt::format("{}:{}: {}", c.place.file, c.place.line, c.notice));
    if (!c.rigid) continue;
    // What makes the nodes one piece where nothing else holds on to the reference node.
    const ValueMaker f = maker(c.place, "forces", entry + "_piece");
    add("forces", entry + "_piece",
        f.table({{"type", f.text("load")}, {"a", f.text(entry)}, {"force", f.vector(Point{})}}));
  }
}

}  // namespace espalier::dynamics::model
