// Linear equations between nodes of solids, and ties, which are such.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/joints/node_equations.hpp"
#include "dynamics/model/builders.hpp"
#include "dynamics/model/equations/face_search.hpp"

namespace espalier::dynamics::model {
namespace {

/// @throws Error where it is no solid with single nodes
const BuiltBody& solid_of(const std::string& name, const Place& place, const FrameBuilder& frames,
                          const Mechanism& out) {
  const BuiltBody* body = out.body(name);
  if (body == nullptr) frames.unknown_body(name, place);
  if (body->reduced != nullptr)
    fail(place, fmt::format("'{}' is reduced, and has no single nodes: take no 'reduce'", name));
  if (body->flexible == nullptr || !body->mesh)
    fail(place, fmt::format("'{}' is no solid; equations and ties are between nodes of solids", name));
  return *body;
}

Vec3 place_at_start(const FrameBuilder& frames, const FlexibleBody& body, Index vertex) {
  return Eigen::Map<const Vec3>(frames.initial_configuration().data() + body.configuration(vertex));
}

/// Adds to the term of the same coordinate, where there is one.
void add_term(NodeEquation& e, const NodeEquation::Term& term) {
  const auto known =
      std::find_if(e.terms.begin(), e.terms.end(), [&](const auto& t) { return t.same_coordinate(term); });
  if (known == e.terms.end())
    e.terms.push_back(term);
  else
    known->factor += term.factor;
}

/// The rest is what the terms are at the start, and `more`.
void settle(NodeEquation& e, const FrameBuilder& frames, double more) {
  std::erase_if(e.terms, [](const NodeEquation::Term& t) { return t.factor == 0; });
  e.rest = more;
  for (const NodeEquation::Term& t : e.terms)
    e.rest += t.factor * place_at_start(frames, *t.body, t.vertex)[t.direction];
}

}  // namespace

void build_equation(const EquationSpec& spec, const FrameBuilder& frames, Mechanism& out) {
  NodeEquation e;
  for (const EquationSpec::Term& term : spec.terms) {
    const BuiltBody& body = solid_of(term.where.body, term.where.place, frames, out);
    at_place(term.where.place, [&] {
      const std::vector<Index> nodes = frames.nodes_of(term.where, body);
      if (nodes.size() != 1)
        throw std::invalid_argument(fmt::format("a term is of one node, these are {}", nodes.size()));
      if (e.label.empty())
        e.label = fmt::format("node {} of '{}', {}", body.mesh->node_label(nodes.front()), term.where.body,
                              "xyz"[term.direction]);
      add_term(e, {body.flexible, nodes.front(), term.direction, term.factor});
    });
  }
  settle(e, frames, spec.value);
  if (e.terms.empty()) fail(spec.place, "the terms cancel each other; nothing is left of the equation");
  if (spec.elastic)
    out.system.add(std::make_unique<NodeSpring>(spec.name, std::move(e), spec.stiffness, spec.damping));
  else
    out.system.add(std::make_unique<NodeEquations>(spec.name, std::vector<NodeEquation>{std::move(e)}));
}

void build_tie(const TieSpec& spec, const FrameBuilder& frames, Mechanism& out) {
  constexpr double kNear = 0.05;  // of the face's extent
  const BuiltBody& body = solid_of(spec.where.body, spec.where.place, frames, out);
  const BuiltBody& to = solid_of(spec.to_body, spec.to_place, frames, out);
  std::vector<NodeEquation> equations;
  long free = 0;
  const std::vector<MeshFace>& faces = to.mesh->face_set(spec.to_face);
  const FaceSearch search(*to.mesh, faces, [&](Index n) { return place_at_start(frames, *to.flexible, n); });
  for (const Index node : frames.nodes_of(spec.where, body)) {
    const FacePoint at = search.nearest(place_at_start(frames, *body.flexible, node));
    if (at.distance > (spec.tolerance > 0 ? spec.tolerance : kNear * at.extent)) {
      ++free;
      continue;
    }
    for (int d = 0; d < 3; ++d) {
      NodeEquation e;
      e.label = fmt::format("node {} of '{}', {}", body.mesh->node_label(node), spec.where.body, "xyz"[d]);
      add_term(e, {body.flexible, node, d, 1});
      for (const auto& [n, weight] : at.weights)
        if (std::abs(weight) > 1e-14) add_term(e, {to.flexible, n, d, -weight});
      settle(e, frames, 0);
      if (e.terms.size() > 1) equations.push_back(std::move(e));  // else the node belongs to the face itself
    }
  }
  if (equations.empty())
    fail(spec.place,
         fmt::format("ties nothing: none of the nodes lies on the faces '{}' of '{}'; 'tolerance' says how far "
                     "away they may be",
                     spec.to_face, spec.to_body));
  if (free > 0)
    out.notices.push_back(
        fmt::format("{}: {} nodes lie too far from the faces '{}' and stay free", spec.name, free, spec.to_face));
  out.system.add(std::make_unique<NodeEquations>(spec.name, std::move(equations)));
}

}  // namespace espalier::dynamics::model
