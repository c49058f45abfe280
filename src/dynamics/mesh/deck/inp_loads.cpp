#include "dynamics/mesh/deck/inp_loads.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "dynamics/mesh/deck/point_algebra.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

/// The axis of BX, BY, BZ; -1: another label.
int force_axis(const std::string& label) {
  return label.size() == 2 && label[0] == 'B' && label[1] >= 'X' && label[1] <= 'Z' ? label[1] - 'X' : -1;
}

/// "P3": a word and a digit from 1 on.
bool is_numbered(const std::string& label, std::string_view word, char last) {
  return label.size() == word.size() + 1 && label.starts_with(word) && label.back() >= '1' && label.back() <= last;
}

}  // namespace

void InpAmplitudes::read(const InpCard& card) {
  const std::string name = upper(card.keyword.need(LineReader(card.place.file, ""), "NAME"));
  for (const auto& [key, given] : card.keyword.parameters) {
    std::string value = upper(given);
    std::erase(value, ' ');
    const bool known = key == "NAME" || (key == "DEFINITION" && value == "TABULAR") ||
                       (key == "TIME" && value == "STEPTIME") || (key == "VALUE" && value == "RELATIVE");
    if (!known) refused_.emplace(name, fmt::format("*AMPLITUDE {}{}{}", key, value.empty() ? "" : "=", value));
  }
  if (refused_.contains(name)) return;
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
  curves_[name] = static_cast<int>(target_.deck().curves.size());
  target_.deck().curves.push_back(std::move(points));
}

int InpAmplitudes::of(const InpCard& card, DeckKind kind) const {
  if (!card.keyword.has("AMPLITUDE")) return -1;
  const std::string name = upper(card.keyword.get("AMPLITUDE"));
  if (const auto refused = refused_.find(name); refused != refused_.end())
    target_.leave(kind, refused->second, card.place);
  else if (const auto found = curves_.find(name); found != curves_.end())
    return found->second;
  else
    fail(card.place, fmt::format("{}: there is no *AMPLITUDE '{}'", card.keyword.name, name));
  return -1;
}

bool InpLoads::begins_anew(const InpCard& card) {
  const std::string& name = card.keyword.name;
  return card.step > 0 && upper(card.keyword.get("OP")) == "NEW" &&
         news_.insert(name == "*DSLOAD" ? "*DLOAD" : name).second;
}

void InpLoads::finish() {
  Deck& deck = target_.deck();
  for (const auto& [key, force] : forces_) deck.forces.push_back(force);
  for (const auto& [key, pressure] : pressures_) deck.pressures.push_back(pressure);
  for (const auto& [key, load] : line_loads_) deck.line_loads.push_back(load);
  deck.body_loads = std::move(body_loads_);
}

void InpLoads::cload(const InpCard& card) {
  if (target_.leaves_parameter(card, DeckKind::cload, {"OP", "AMPLITUDE"})) return;
  if (begins_anew(card)) forces_.clear();
  const int curve = amplitudes_.of(card, DeckKind::cload);
  for (std::size_t l = 0; l < card.lines.size(); ++l) {
    const CardFields f = card.fields(l);
    const std::int64_t direction = f.integer(1, "degree of freedom");
    if (direction == 11 || direction == 0) {
      target_.leave(DeckKind::cload, fmt::format("*CLOAD of degree of freedom {}", direction), card.place);
      continue;
    }
    if (direction < 1 || direction > 6)
      fail(f.place(), fmt::format("*CLOAD: degree of freedom {}; 1 to 3 are forces, 4 to 6 moments", direction));
    const double value = f.real(2, "force");
    for (const Index node : target_.nodes(card, f, 0)) {
      const std::pair key(node, static_cast<int>(direction - 1));
      add_or_replace(forces_, key, DeckForce{f.place(), node, key.second, value, curve, card.step}, card);
    }
  }
}

template <class Key, class Load>
void InpLoads::add_or_replace(std::map<Key, Load>& loads, const Key& key, const Load& load, const InpCard& card) {
  const auto [known, added] = loads.emplace(key, load);
  if (added) return;
  if (known->second.step == card.step && known->second.curve == load.curve) {
    if constexpr (std::is_same_v<Load, DeckLineLoad>)
      known->second.force = difference_of(known->second.force, scaled_by(-1, load.force));
    else
      known->second.value += load.value;
  } else if (known->second.step == card.step) {
    fail(load.place, fmt::format("{}: the load of line {} acts at the same place with another AMPLITUDE; make one "
                                 "curve of the two",
                                 card.keyword.name, known->second.place.line));
  } else {
    known->second = load;
  }
}

void InpLoads::dload(const InpCard& card) {
  if (target_.leaves_parameter(card, DeckKind::dload, {"OP", "AMPLITUDE"})) return;
  if (begins_anew(card)) {
    pressures_.clear();
    line_loads_.clear();
    body_loads_.clear();
  }
  const int curve = amplitudes_.of(card, DeckKind::dload);
  for (std::size_t l = 0; l < card.lines.size(); ++l) {
    const CardFields f = card.fields(l);
    const std::string label = upper(f.text(1));
    const bool surface = card.keyword.name == "*DSLOAD";
    if (!surface && (label == "GRAV" || label == "CENTRIF" || force_axis(label) >= 0))
      body_load(card, f, label, curve);
    else if (label == "P" || (!surface && is_numbered(label, "P", '6')))
      pressure(card, f, label, curve);
    else if (!surface && (label == "PX" || label == "PY" || label == "PZ"))
      line_load(card, f, static_cast<std::size_t>(label[1] - 'X'), curve);
    else if (!surface && is_numbered(label, "EDNOR", '4'))
      edge_load(card, f, label.back() - '1', curve);
    else
      target_.leave(DeckKind::dload, fmt::format("{} {}", card.keyword.name, label), card.place);
  }
}

void InpLoads::pressure(const InpCard& card, const CardFields& f, const std::string& label, int curve) {
  const Mesh& mesh = target_.lookup().mesh();
  std::vector<MeshFace> faces;
  if (card.keyword.name == "*DSLOAD") {
    faces = target_.faces(card, f);
  } else {
    for (const Index e : target_.elements(card, f)) {
      const auto& shape = shape_of(mesh.type(e));
      if (shape.dimension == 2 && label == "P") {  // along the normal
        faces.push_back({e, kShellBottom});
        continue;
      }
      if (shape.dimension == 1 && label != "P")
        fail(f.place(), fmt::format("*DLOAD {}: on beams this is a force per length in Abaqus, and a pressure in "
                                    "CalculiX: write PX, PY, PZ, forces per length along x, y, z",
                                    label));
      if (shape.dimension < 3 || label == "P") {
        target_.leave(DeckKind::dload, fmt::format("*DLOAD {} of {}", label, shape.name), card.place);
        continue;
      }
      if (label[1] - '0' > static_cast<int>(shape.faces.size()))
        fail(f.place(), fmt::format("*DLOAD {}: element {} ({}) has {} faces", label, element_name(mesh, e), shape.name,
                                    shape.faces.size()));
      faces.push_back({e, label[1] - '1'});
    }
  }
  const double value = f.real(2, "pressure");
  if (faces.empty())
    target_.leave(DeckKind::dload, fmt::format("{} of elements that are not read", card.keyword.name), card.place);
  for (const MeshFace& at : faces)
    add_or_replace(pressures_, at, DeckPressure{f.place(), at, value, curve, card.step}, card);
}

void InpLoads::line_load(const InpCard& card, const CardFields& f, std::size_t axis, int curve) {
  const Mesh& mesh = target_.lookup().mesh();
  const double value = f.real(2, "force per length");
  for (const Index e : target_.elements(card, f)) {
    if (shape_of(mesh.type(e)).dimension != 1) {
      target_.leave(DeckKind::dload, fmt::format("*DLOAD {} of {}", f.text(1), shape_of(mesh.type(e)).name),
                    card.place);
      continue;
    }
    DeckLineLoad load{f.place(), e, -1, {}, curve, card.step};
    load.force[axis] = value;
    add_or_replace(line_loads_, {e, -1, static_cast<int>(axis)}, load, card);
  }
}

/// Across an edge, in the plane of the shell, towards the element.
void InpLoads::edge_load(const InpCard& card, const CardFields& f, int edge, int curve) {
  const Mesh& mesh = target_.lookup().mesh();
  const double value = f.real(2, "force per length");
  for (const Index e : target_.elements(card, f)) {
    const auto& shape = shape_of(mesh.type(e));
    if (shape.dimension != 2 || edge >= shape.corners) {
      target_.leave(DeckKind::dload, fmt::format("*DLOAD {} of {}", f.text(1), shape.name), card.place);
      continue;
    }
    const auto nodes = mesh.element(e);
    const auto at = [&](int a) { return mesh.nodes[static_cast<std::size_t>(nodes[static_cast<std::size_t>(a)])]; };
    const auto corner = [&](int a) { return at(a % shape.corners); };
    const Point along = difference_of(corner(edge + 1), corner(edge));
    const Point normal = cross_product(along, difference_of(corner(edge + 2), corner(edge)));
    const Point inward = direction_of(cross_product(normal, along));
    add_or_replace(line_loads_, {e, edge, 3},
                   DeckLineLoad{f.place(), e, edge, scaled_by(value, inward), curve, card.step}, card);
  }
}

void InpLoads::body_load(const InpCard& card, const CardFields& f, const std::string& label, int curve) {
  const double value = f.real(2, label == "GRAV"      ? "acceleration"
                                 : label == "CENTRIF" ? "square of the speed"
                                                      : "force");
  DeckBodyLoad load{f.place(), label, {}, {}, {}, {}, {}, curve, card.step, upper(f.text(0)), {}};
  if (f.has(0)) load.elements = target_.elements(card, f);
  sort_unique(load.elements);
  load.homes = target_.lookup().homes(card.scope);
  const std::size_t vector = label == "CENTRIF" ? 6 : 3;
  const Point direction =
      direction_of({f.real(vector, "x", 0), f.real(vector + 1, "y", 0), f.real(vector + 2, "z", 0)});
  if (const int axis = force_axis(label); axis >= 0)
    load.per_volume[static_cast<std::size_t>(axis)] = value;
  else if (direction == Point{})
    fail(f.place(), fmt::format("*DLOAD {}: the direction is zero", label));
  if (label == "CENTRIF" && value < 0)
    fail(f.place(), fmt::format("*DLOAD CENTRIF: the square of the speed is {:g}; it is not negative", value));
  for (std::size_t d = 0; d < 3; ++d) {
    if (label == "GRAV") load.acceleration[d] = value * direction[d];
    if (label != "CENTRIF") continue;
    load.spin[d] = std::sqrt(value) * direction[d];
    load.point[d] = f.real(3 + d, "point of the axis", 0);
  }
  // A step replaces what the ones before say of the same elements; in CalculiX gravity in another direction is added.
  std::erase_if(body_loads_, [&](const DeckBodyLoad& old) {
    const bool same = old.set == load.set || (!load.elements.empty() && old.elements == load.elements);
    if (old.step == card.step || old.label != load.label || !same) return false;
    constexpr double kNear = 1e-10;
    if (label == "GRAV" && std::abs(dot_product(direction_of(old.acceleration), direction)) < 1 - kNear)
      target_.leave(DeckKind::gravity, "*DLOAD GRAV in another direction than in the step before, without OP=NEW",
                    card.place);
    return true;
  });
  body_loads_.push_back(std::move(load));
}

}  // namespace espalier::dynamics
