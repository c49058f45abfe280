// Loads of a deck.
#include <optional>

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
  std::map<std::pair<Point, int>, std::pair<std::vector<Index>, DeckPlace>> groups;  // of nodes of solids
  for (const auto& [key, load] : loads) {
    const auto& [node, curve] = key;
    if (role(node) == NodeRole::alone) {
      if (grounded_.contains(node)) continue;  // the ground bears it
      dynamics::fail(load.place,
                     fmt::format("the load acts on node {}, which belongs to no solid, mass or coupling", name(node)));
    }
    if (load.moment != Point{} && (role(node) == NodeRole::solid || role(node) == NodeRole::mass))
      dynamics::fail(load.place,
                     fmt::format("a moment acts on node {}, which does not turn; put it on the reference node of a "
                                 "coupling",
                                 name(node)));
    if (role(node) == NodeRole::solid) {
      auto& group = groups[{load.force, curve}];
      if (group.first.empty()) group.second = load.place;
      group.first.push_back(node);
    } else {
      add_load(load, curve, node);
    }
  }
  for (const auto& [key, group] : groups) {
    const std::string entry = fresh_name("force");
    const ValueMaker m = maker(group.second, "forces", entry);
    Point sum = key.first;
    for (double& x : sum) x *= static_cast<double>(group.first.size());  // the frame spreads it evenly
    Value a = m.table({{"body", m.text(body_)}, {"nodes", m.text(node_set("deck-" + entry, group.first))}});
    add_force(m, entry, std::move(a), sum, Point{}, key.second);
  }
}

void Taker::add_load(const Load& load, int curve, Index node) {
  const std::string entry = fresh_name("force");
  const ValueMaker m = maker(load.place, "forces", entry);
  Point moment = load.moment;
  if (role(node) == NodeRole::mean_reference) {  // its frame stands at the mean of the nodes
    const Point mean = mean_of(node);
    const Point arm = {at(node)[0] - mean[0], at(node)[1] - mean[1], at(node)[2] - mean[2]};
    for (std::size_t d = 0; d < 3; ++d) {
      const std::size_t e = (d + 1) % 3, g = (d + 2) % 3;
      moment[d] += arm[e] * load.force[g] - arm[g] * load.force[e];
    }
  }
  add_force(m, entry, frame(m, node), load.force, moment, curve);
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
  std::map<std::pair<double, int>, std::pair<std::vector<MeshFace>, DeckPlace>> groups;
  for (const DeckPressure& p : deck_.pressures) {
    const double value = p.value * (p.curve >= 0 && !motion ? at_end(p.curve) : 1);
    auto& group = groups[{value, motion ? p.curve : -1}];
    if (group.first.empty()) group.second = p.place;
    group.first.push_back(p.face);
  }
  for (const auto& [key, group] : groups) {
    const std::string entry = fresh_name("pressure");
    const ValueMaker m = maker(group.second, "forces", entry);
    out_.face_sets["deck-" + entry] = group.first;
    Value value =
        key.second >= 0 ? m.text(fmt::format("{}*{}(t)", key.first, spline(key.second))) : m.number(key.first);
    add("forces", entry,
        m.table({{"type", m.text("pressure")},
                 {"body", m.text(body_)},
                 {"face", m.text("deck-" + entry)},
                 {"pressure", std::move(value)}}));
  }
}

bool Taker::weighs() const {
  return choice_.takes(DeckKind::gravity) &&
         !(deck_.step.kind == DeckStep::Kind::modes && choice_.takes(DeckKind::step));
}

void Taker::gravity() {
  if (deck_.gravity.empty() || !weighs()) return;
  // Solids on which it acts; it must be all of them.
  std::vector<Point> at_element(static_cast<std::size_t>(deck_.mesh.element_count()));
  for (const DeckGravity& g : deck_.gravity) {
    std::vector<Index> elements = g.elements;
    if (g.set.empty())
      for (Index e = 0; e < deck_.mesh.element_count(); ++e) elements.push_back(e);
    for (const Index e : elements)
      for (std::size_t d = 0; d < 3; ++d) at_element[static_cast<std::size_t>(e)][d] += g.acceleration[d];
  }
  std::optional<Point> all;
  for (Index e = 0; e < deck_.mesh.element_count(); ++e) {
    if (shape_of(deck_.mesh.type(e)).dimension < 3) continue;
    const Point& here = at_element[static_cast<std::size_t>(e)];
    if (all && *all != here)
      dynamics::fail(deck_.gravity.front().place,
                     fmt::format("gravity acts otherwise on element {} than on others: it must be "
                                 "the same for all solids of a body",
                                 element_name(deck_.mesh, e)));
    all = here;
  }
  const ValueMaker m(deck_.gravity.front().place, fmt::format("bodies.{}.gravity", body_));
  if (all) out_.body_keys.emplace_back("gravity", m.vector(*all));
}

}  // namespace espalier::dynamics::model
