#include "dynamics/model/assembly/line_loads.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "dynamics/bodies/reduced_frame.hpp"
#include "dynamics/elements/line_point.hpp"
#include "dynamics/model/assembly/line_body.hpp"
#include "dynamics/model/assembly/line_elements.hpp"

namespace espalier::dynamics::model {
namespace {

using Edge = std::pair<Index, Index>;

Vec3 reference_of_vertex(const FlexibleBody& body, Index vertex) {
  return Eigen::Map<const Vec3>(body.reference().data() + 3 * vertex);
}

std::unique_ptr<Frame> frame_of(const BuiltBody& body, std::vector<FrameVertex> vertices) {
  auto frame = std::make_unique<FlexibleFrame>(*body.flexible, std::move(vertices));
  if (body.reduced != nullptr) return std::make_unique<ReducedFrame>(*body.reduced, *frame);
  return frame;
}

/// Edges of elements between the nodes: along the boundary where all nodes lie there.
std::vector<Edge> edges_between(const ShellSpec& shell, const std::vector<Index>& nodes) {
  const Mesh& mesh = *shell.mesh;
  const auto chosen = [&](Index k) { return std::binary_search(nodes.begin(), nodes.end(), k); };
  std::map<Edge, int> all;  // with the number of their elements
  for (Index e = 0; e < mesh.element_count(); ++e) {
    const auto quad = mesh.element(e);
    for (std::size_t a = 0; a < 4; ++a)
      if (const Index p = quad[a], q = quad[(a + 1) % 4]; chosen(p) && chosen(q)) ++all[std::minmax(p, q)];
  }
  for (const bool outer : {true, false}) {
    std::vector<Edge> line;
    std::map<Index, int> ends;
    for (const auto& [edge, elements] : all) {
      if (outer && elements > 1) continue;
      line.push_back(edge);
      ++ends[edge.first];
      ++ends[edge.second];
    }
    const bool is_line = std::all_of(ends.begin(), ends.end(), [](const auto& end) { return end.second <= 2; });
    if (is_line && !ends.empty() && ends.size() == nodes.size()) return line;
  }
  throw std::invalid_argument(
      fmt::format("these {} nodes are no line along edges of elements: name those of one edge", nodes.size()));
}

/// Two Gauss points on an edge. The director says how a point turns; the edge, with a thousandth of its weight, how it
/// turns about the director.
std::vector<LoadedPoint> on_edges(const BuiltBody& body, const ShellSpec& shell, const std::vector<Edge>& edges) {
  constexpr double kEdge = 1e-3;
  std::vector<LoadedPoint> out;
  for (const auto& [a, b] : edges) {
    const std::array<Index, 2> ends = {a, b};
    const auto node = [&](std::size_t k) {
      return Vec3(reference_of_vertex(*body.flexible, 2 * ends[k]) -
                  shell.offset * reference_of_vertex(*body.flexible, 2 * ends[k] + 1));
    };
    const Vec3 along = node(1) - node(0);
    for (const LinePoint& point : kGauss2) {
      const std::array<double, 2> share = {0.5 * (1 - point.xi), 0.5 * (1 + point.xi)};
      Vec3 director = Vec3::Zero();
      for (std::size_t k = 0; k < 2; ++k) director += share[k] * reference_of_vertex(*body.flexible, 2 * ends[k] + 1);
      const Vec3 arm = kEdge * director.squaredNorm() / along.squaredNorm() * along;
      std::vector<FrameVertex> vertices;
      for (std::size_t k = 0; k < 2; ++k) {
        vertices.push_back({2 * ends[k], share[k], k == 0 ? Vec3(-arm) : arm});
        vertices.push_back({2 * ends[k] + 1, -shell.offset * share[k], share[k] * director});
      }
      out.push_back({frame_of(body, std::move(vertices)), 0.5 * point.weight * along.norm()});
    }
  }
  return out;
}

/// Two Gauss points of each element, which are exact for Hermite's cubics; of elements in a row only between two shares
/// of their number.
std::vector<LoadedPoint> on_elements(const BuiltBody& body, const std::vector<LineElement>& elements,
                                     double from_share = 0, double to_share = 1) {
  const Index each = body.flexible->vertices_per_node();
  const auto count = static_cast<double>(elements.size());
  std::vector<LoadedPoint> out;
  double before = 0;
  for (const LineElement& e : elements) {
    const double low = std::clamp(from_share * count - before, 0.0, 1.0),
                 part = std::clamp(to_share * count - before, 0.0, 1.0) - low;
    before += 1;
    if (!(part > 0)) continue;
    for (const LinePoint& point : kGauss2) {
      const double xi = 2 * low - 1 + part * (1 + point.xi);
      const Hermite h(xi, e.length);
      std::vector<FrameVertex> vertices;
      for (std::size_t k = 0; k < 2; ++k) {
        vertices.push_back({each * e.nodes[k], h.n[2 * k], Vec3::Zero()});
        vertices.push_back({each * e.nodes[k] + 1, h.n[2 * k + 1], Vec3::Zero()});
      }
      for (Index axis = 2; axis < each; ++axis) {  // of beams: the section's y and z
        const std::array<double, 2> share = {0.5 * (1 - xi), 0.5 * (1 + xi)};
        Vec3 arm = Vec3::Zero();
        for (std::size_t k = 0; k < 2; ++k)
          arm += share[k] * reference_of_vertex(*body.flexible, each * e.nodes[k] + axis);
        for (std::size_t k = 0; k < 2; ++k) vertices.push_back({each * e.nodes[k] + axis, 0, share[k] * arm});
      }
      out.push_back({frame_of(body, std::move(vertices)), 0.5 * point.weight * part * e.length});
    }
  }
  return out;
}

std::vector<LineElement> elements_of_set(const BuiltBody& body, const std::vector<LineElement>& all,
                                         const std::string& set) {
  const LineFile* file = line_file(body);
  if (file == nullptr)
    throw std::invalid_argument("'element_set' is of beams and cables of mesh files; say where by nodes");
  std::vector<LineElement> out;
  for (const Index e : file->mesh->element_set(set)) out.push_back(all[at(e)]);
  return out;
}

bool names_nodes(const MarkerSpec& m) {
  return m.node || m.near || !m.along.empty() || !m.face.empty() || m.by_nodes() || m.bore || !m.edge.empty();
}

}  // namespace

std::vector<LoadedPoint> points_of_line(const MarkerSpec& where, const std::string& element_set, const BuiltBody& body,
                                        const FrameBuilder& frames) {
  std::vector<LineElement> elements = line_elements(body);
  const auto* shell = std::get_if<ShellSpec>(&body.spec.shape);
  if (elements.empty() && shell == nullptr)
    throw std::invalid_argument(fmt::format(
        "'{}' is no shell, beam or cable, which loads per length act on; take a load, whose force is that of "
        "all nodes together",
        where.body));
  if (!element_set.empty()) elements = elements_of_set(body, elements, element_set);
  if (!names_nodes(where)) {
    if (shell != nullptr)
      throw std::invalid_argument("say where: edge = \"x1\" of a grid, nodes = \"SET\" of a mesh file");
    return on_elements(body, elements);
  }
  if (where.along.size() == 2 && shell == nullptr && line_file(body) == nullptr) {
    if (!(where.along[1] > where.along[0])) throw std::invalid_argument("no length lies between these shares");
    return on_elements(body, elements, where.along[0], where.along[1]);
  }
  const std::vector<Index> nodes = frames.nodes_of(where, body);
  if (shell != nullptr) return on_edges(body, *shell, edges_between(*shell, nodes));
  std::map<Index, Index> first;  // of nodes where chains of a file meet
  if (const LineFile* file = line_file(body))
    for (const auto& pair : file->joined) first[pair[1]] = pair[0];
  std::erase_if(elements, [&](const LineElement& e) {
    return !std::all_of(e.nodes.begin(), e.nodes.end(), [&](Index k) {
      const auto known = first.find(k);
      return std::binary_search(nodes.begin(), nodes.end(), known == first.end() ? k : known->second);
    });
  });
  if (elements.empty()) throw std::invalid_argument("no element of the line lies between these nodes");
  return on_elements(body, elements);
}

}  // namespace espalier::dynamics::model
