#include "dynamics/device/body_parts.hpp"

#include <algorithm>

#include "base/at.hpp"

namespace espalier::dynamics {

namespace {

/// Makes one part after another.
class Division {
 public:
  Division(const DeviceBodyTables& body, std::span<const Index> place_of_vertex)
      : body_(body), place_of_vertex_(place_of_vertex), local_(at(body.vertices())) {}

  BodySubdomain part(Index place) {
    BodySubdomain part{};
    part.place = place;
    part.mass_damping = body_.mass_damping;
    part.stiffness_damping = body_.stiffness_damping;
    take_elements(part);
    number_vertices(part);
    for (DeviceElements& group : part.groups)
      for (Index& vertex : group.vertices) vertex = local_[at(vertex)];
    take_columns(part);
    return part;
  }

 private:
  static constexpr Index kAbsent = -1, kPresent = 0;
  [[nodiscard]] bool owns(const BodySubdomain& part, Index vertex) const {
    return place_of_vertex_[at(vertex)] == part.place;
  }

  // Those with an own vertex. Marks their vertices.
  void take_elements(BodySubdomain& part) {
    std::fill(local_.begin(), local_.end(), kAbsent);
    for (Index v = 0; v < body_.vertices(); ++v)
      if (owns(part, v)) local_[at(v)] = kPresent;
    Index first = 0;
    for (const DeviceElements& group : body_.groups) {
      DeviceElements taken{group.law, group.nodes, {}};
      for (Index e = 0; e < group.elements(); ++e) {
        const auto nodes = std::span(group.vertices).subspan(at(e * Offset{group.nodes}), at(group.nodes));
        if (std::none_of(nodes.begin(), nodes.end(), [&](Index v) { return owns(part, v); })) continue;
        part.elements.push_back(first + e);
        taken.vertices.insert(taken.vertices.end(), nodes.begin(), nodes.end());
        for (const Index v : nodes) local_[at(v)] = kPresent;
      }
      if (!taken.vertices.empty()) part.groups.push_back(std::move(taken));
      first += group.elements();
    }
  }

  void number_vertices(BodySubdomain& part) {
    for (Index v = 0; v < body_.vertices(); ++v) {
      if (local_[at(v)] == kAbsent) continue;
      local_[at(v)] = static_cast<Index>(part.vertices.size());
      if (owns(part, v)) part.own.push_back(local_[at(v)]);
      part.vertices.push_back(v);
      for (std::size_t i = 0; i < 3; ++i) {
        part.reference.push_back(body_.reference[3 * at(v) + i]);
        part.weight.push_back(body_.weight[3 * at(v) + i]);
      }
    }
  }

  void take_columns(BodySubdomain& part) const {
    const VertexPattern& all = *body_.pattern;
    part.pattern.ptr.push_back(0);
    for (const Index v : part.vertices) {
      for (Offset e = all.ptr[at(v)]; e < all.ptr[at(v) + 1] && owns(part, v); ++e) {
        part.pattern.ind.push_back(local_[at(all.ind[at(e)])]);
        part.entries.push_back(e);
        part.mass.push_back(body_.mass[at(e)]);
      }
      part.pattern.ptr.push_back(static_cast<Offset>(part.entries.size()));
    }
  }

  const DeviceBodyTables& body_;
  std::span<const Index> place_of_vertex_;
  std::vector<Index> local_;  // of the body's vertices, in the present part
};

}  // namespace

DeviceBodyTables BodySubdomain::tables() const {
  DeviceBodyTables t;
  t.groups = groups;
  t.reference = reference;
  t.pattern = &pattern;
  t.mass = mass;
  t.weight = weight;
  t.mass_damping = mass_damping;
  t.stiffness_damping = stiffness_damping;
  return t;
}

std::vector<BodySubdomain> divide_body(const DeviceBodyTables& body, std::span<const Index> place_of_vertex) {
  std::vector<Index> places(place_of_vertex.begin(), place_of_vertex.end());
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  Division division(body, place_of_vertex);
  std::vector<BodySubdomain> parts;
  for (const Index place : places) parts.push_back(division.part(place));
  return parts;
}

}  // namespace espalier::dynamics
