// Supports of a deck.
#include <cmath>
#include <tuple>

#include "dynamics/model/decks/taker.hpp"

namespace espalier::dynamics::model {
namespace {

/// Unit quaternion w, x, y, z of the rotation whose columns are these axes.
std::array<double, 4> quaternion_of(const std::array<Point, 3>& c) {
  const double trace = c[0][0] + c[1][1] + c[2][2];
  std::array<double, 4> q{};
  if (trace > 0) {
    const double s = 2 * std::sqrt(1 + trace);
    q = {s / 4, (c[1][2] - c[2][1]) / s, (c[2][0] - c[0][2]) / s, (c[0][1] - c[1][0]) / s};
  } else {
    const std::size_t i = c[0][0] >= c[1][1] && c[0][0] >= c[2][2] ? 0U : c[1][1] >= c[2][2] ? 1U : 2U;
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    const double s = 2 * std::sqrt(1 + c[i][i] - c[j][j] - c[k][k]);
    q[0] = (c[j][k] - c[k][j]) / s;
    q[1 + i] = s / 4;
    q[1 + j] = (c[i][j] + c[j][i]) / s;
    q[1 + k] = (c[i][k] + c[k][i]) / s;
  }
  return q;
}

}  // namespace

void Taker::holds() {
  std::map<Index, Held> all;
  for (const DeckHold& h : deck_.holds) all[h.node].by[static_cast<std::size_t>(h.direction)] = &h;
  // Nodes that are held alike make one support.
  using Key = std::tuple<std::string, std::string, std::array<double, 4>, std::string>;
  std::map<Key, std::pair<std::vector<Index>, Held>> groups;
  std::vector<Key> order;
  for (const auto& [node, held] : all) {
    if (role(node) == NodeRole::alone) continue;  // see find_roles()
    const DeckPlace& place =
        (*std::find_if(held.by.begin(), held.by.end(), [](const auto* h) { return h != nullptr; }))->place;
    if (is_reference(node)) {
      hold_reference(node, held, place);
    } else if (role(node) == NodeRole::mass || role(node) == NodeRole::mean_place) {
      hold_place(node, held);
    } else {
      if (const auto rigid = rigid_nodes_.find(node); rigid != rigid_nodes_.end())
        dynamics::fail(
            place, fmt::format("node {} is held, and follows the rigid coupling of line {}; hold its reference node",
                               name(node), deck_.couplings[static_cast<std::size_t>(rigid->second)].place.line));
      for (std::size_t d = 3; d < 6 && !turns(node); ++d) turned_ += held.by[d] != nullptr ? 1 : 0;
      if (!held.any(0, turns(node) ? 6 : 3)) continue;
      std::string directions, motions;
      for (std::size_t d = 0; d < (turns(node) ? 6U : 3U); ++d) {
        if (held.by[d] == nullptr) continue;
        directions += "xyzXYZ"[d];
        if (held.by[d]->value == 0) continue;
        motions += fmt::format("{}={};", "xyz"[d % 3], motion_of(*held.by[d]));
        if (d > 2)
          dynamics::fail(held.by[d]->place,
                         fmt::format("node {} is turned by {:g}: rotations of nodes that move are not taken; lead the "
                                     "displacements of two nodes, or put a moment there",
                                     name(node), held.by[d]->value));
      }
      const auto axes = deck_.axes.find(node);
      const Key key(directions, motions,
                    axes == deck_.axes.end() ? std::array<double, 4>{1, 0, 0, 0} : quaternion_of(axes->second),
                    home(node).name);
      auto [group, fresh] = groups.try_emplace(key, std::vector<Index>(), held);
      if (fresh) order.push_back(key);
      group->second.first.push_back(node);
    }
  }
  for (const Key& key : order) add_support(std::get<2>(key), groups.at(key).first, groups.at(key).second);
}

void Taker::add_support(const std::array<double, 4>& quaternion, const std::vector<Index>& nodes, const Held& held) {
  const std::string entry = fresh_name("hold");
  const DeckHold& first = **std::find_if(held.by.begin(), held.by.end(), [](const auto* h) { return h != nullptr; });
  const ValueMaker m = maker(first.place, "supports", entry);
  std::string directions, rotations;
  for (std::size_t d = 0; d < 3; ++d) {
    if (held.by[d] != nullptr) directions += "xyz"[d];
    if (held.by[3 + d] != nullptr && turns(nodes.front())) rotations += "xyz"[d];
  }
  const bool clamped = directions.size() + rotations.size() == 6 && !held.moved();
  Value support =
      m.table({{"body", m.text(home(nodes.front()).name)}, {"nodes", m.text(node_set("deck-" + entry, nodes))}});
  if (!directions.empty()) support.entries.emplace_back("hold", m.text(clamped ? "all" : directions));
  if (!rotations.empty() && !clamped) support.entries.emplace_back("rotations", m.text(rotations));
  if (held.moved()) {
    Value motion = m.table({});
    for (std::size_t d = 0; d < 3; ++d)
      if (held.by[d] != nullptr && held.by[d]->value != 0)
        motion.entries.emplace_back(std::string(1, "xyz"[d]), m.text(motion_of(*held.by[d])));
    support.entries.emplace_back("motion", std::move(motion));
  }
  if (quaternion[0] != 1) {
    std::vector<Value> q;
    for (const double x : quaternion) q.push_back(m.number(x));
    support.entries.emplace_back("rotation", m.table({{"quaternion", m.list(std::move(q))}}));
  }
  add("supports", entry, std::move(support));
  outputs_.push_back(entry + ".force");
}

std::string Taker::motion_of(const DeckHold& h) {
  if (h.curve < 0) return fmt::format("{}", h.value);
  if (deck_.step.kind != DeckStep::Kind::motion) return fmt::format("{}", h.value * at_end(h.curve));
  return fmt::format("{}*{}(t)", h.value, spline(h.curve));
}

double Taker::at_end(int curve) const {
  const auto& points = deck_.curves[static_cast<std::size_t>(curve)];
  const double t = deck_.step.period;
  if (t <= points.front().first) return points.front().second;
  for (std::size_t k = 1; k < points.size(); ++k)
    if (t <= points[k].first) {
      const auto& [t0, f0] = points[k - 1];
      return f0 + (points[k].second - f0) * (t - t0) / (points[k].first - t0);
    }
  return points.back().second;
}

std::string Taker::spline(int curve) {
  std::string entry = fmt::format("{}_amplitude_{}", body_, curve + 1);
  if (!splines_.insert(entry).second) return entry;
  const ValueMaker m = maker({deck_.mesh.name, 0}, "splines", entry);
  std::vector<Value> points;
  for (const auto& [t, f] : deck_.curves[static_cast<std::size_t>(curve)])
    points.push_back(m.list({m.number(t), m.number(f)}));
  if (points.size() == 1) points.push_back(m.list({m.number(points[0].items[0].real + 1), points[0].items[1]}));
  add("splines", entry,
      m.table({{"points", m.list(std::move(points))}, {"kind", m.text("linear")}, {"outside", m.text("constant")}}));
  return entry;
}

void Taker::hold_reference(Index node, const Held& held, const DeckPlace& place) {
  if (deck_.axes.contains(node))
    dynamics::fail(place,
                   fmt::format("the reference node {} is held along axes of its own (*TRANSFORM), which is not taken",
                               name(node)));
  std::string translations, rotations;
  for (std::size_t d = 0; d < 3; ++d) {
    if (held.by[d] != nullptr) translations += "xyz"[d];
    if (held.by[3 + d] != nullptr) rotations += "xyz"[d];
    if (held.by[3 + d] != nullptr && held.by[3 + d]->value != 0)
      dynamics::fail(held.by[3 + d]->place,
                     fmt::format("the reference node {} is turned by {:g}; take a joint of the model "
                                 "for it (type = \"rotation-motor\")",
                                 name(node), held.by[3 + d]->value));
  }
  const bool moved = held.moved();
  if (rotations.empty() && (moved || translations != "xyz")) {
    for (std::size_t d = 0; d < 3; ++d)
      if (held.by[d] != nullptr) add_prescribed(node, *held.by[d], d);
    return;
  }
  std::string type;
  std::size_t axis = 2;
  if (!moved && translations == "xyz")
    type = rotations == "xyz" ? "fixed" : rotations.empty() ? "spherical" : rotations.size() == 2 ? "revolute" : "";
  else if (!moved && rotations == "xyz" && translations.size() == 2)
    type = "prismatic";
  const std::string& held_two = type == "revolute" ? rotations : translations;
  if (type == "revolute" || type == "prismatic")
    for (std::size_t d = 0; d < 3; ++d)
      if (held_two.find("xyz"[d]) == std::string::npos) axis = d;
  if (type.empty())
    dynamics::fail(place,
                   fmt::format("the reference node {} is held along '{}' and about '{}'{}: no joint does so; take one "
                               "of the model for it",
                               name(node), translations, rotations, moved ? ", and moved" : ""));
  const std::string entry = fresh_name("joint");
  const ValueMaker m = maker(place, "joints", entry);
  Point direction{};
  direction[axis] = 1;
  add("joints", entry,
      m.table(
          {{"type", m.text(type)},
           {"a", m.table({{"body", m.text("ground")}, {"point", m.vector(at(node))}, {"axis", m.vector(direction)}})},
           {"b", m.text(coupling_name(node))}}));
  outputs_.push_back(entry + ".force");
  outputs_.push_back(entry + ".moment");
}

Point Taker::place_of(Index node) const {
  if (role(node) != NodeRole::mean_place) return at(node);
  const DeckCoupling& c = deck_.couplings[static_cast<std::size_t>(references_.at(node))];
  Point sum{};
  double all = 0;
  for (std::size_t k = 0; k < c.nodes.size(); ++k) {
    const double weight = c.weights.empty() ? 1 : c.weights[k];
    all += weight;
    for (std::size_t d = 0; d < 3; ++d) sum[d] += weight * at(c.nodes[k])[d];
  }
  for (double& x : sum) x /= all;
  return sum;
}

void Taker::add_prescribed(Index node, const DeckHold& h, std::size_t d) {
  const std::string entry = fresh_name("joint");
  const ValueMaker m = maker(h.place, "joints", entry);
  add("joints", entry,
      m.table({{"type", m.text("prescribed")},
               {"a", m.text("ground")},
               {"b", frame(m, node)},
               {"direction", m.text(std::string(1, "xyz"[d]))},
               {"motion", m.text(fmt::format("{} + ({})", place_of(node)[d], motion_of(h)))}}));
  outputs_.push_back(entry + ".force");
}

}  // namespace espalier::dynamics::model
