// Linear equations between nodes of flexible bodies.
#include <fmt/format.h>

#include <algorithm>

#include "dynamics/joints/node_equations.hpp"
#include "dynamics/model/assembly/shell_body.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/frames/labels.hpp"

namespace espalier::dynamics::model {
namespace {

/// @throws Error where it has no single nodes
const BuiltBody& body_with_nodes(const std::string& name, const Place& place, const FrameBuilder& frames,
                                 const Mechanism& out) {
  const BuiltBody* body = out.body(name);
  if (body == nullptr) frames.unknown_body(name, place);
  if (body->reduced != nullptr)
    fail(place, fmt::format("'{}' is reduced, and has no single nodes: take no 'reduce'", name));
  if (body->flexible == nullptr)
    fail(place, fmt::format("'{}' has no nodes; equations are between those of flexible bodies", name));
  return *body;
}

/// A node's place, which may be beside the middle of a shell's thickness.
std::vector<std::pair<Index, double>> place_of_node(const BuiltBody& body, Index node) {
  if (std::holds_alternative<ShellSpec>(body.spec.shape)) {
    std::vector<std::pair<Index, double>> parts = shell_node(body, node).parts;
    std::erase_if(parts, [](const auto& part) { return part.second == 0; });
    return parts;
  }
  return {{body.flexible->vertices_per_node() * node, 1}};
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
    const BuiltBody& body = body_with_nodes(term.where.body, term.where.place, frames, out);
    at_place(term.where.place, [&] {
      const std::vector<Index> nodes = frames.nodes_of(term.where, body);
      if (nodes.size() != 1)
        throw std::invalid_argument(fmt::format("a term is of one node, these are {}", nodes.size()));
      const Mesh* mesh = named_mesh(body);
      if (e.label.empty())
        e.label = fmt::format("node {} of '{}', {}",
                              mesh != nullptr ? mesh->node_label(nodes.front()) : std::int64_t{nodes.front()} + 1,
                              term.where.body, "xyz"[term.direction]);
      for (const auto& [vertex, factor] : place_of_node(body, nodes.front()))
        add_term(e, {body.flexible, vertex, term.direction, factor * term.factor});
    });
  }
  settle(e, frames, spec.value);
  if (e.terms.empty()) fail(spec.place, "the terms cancel each other; nothing is left of the equation");
  if (spec.elastic)
    out.system.add(std::make_unique<NodeSpring>(spec.name, std::move(e), spec.stiffness, spec.damping));
  else
    out.system.add(std::make_unique<NodeEquations>(spec.name, std::vector<NodeEquation>{std::move(e)}));
}

}  // namespace espalier::dynamics::model
