// Frames on several points of a flexible body: nodes of solids, and both sides of a shell at its nodes.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>

#include "base/at.hpp"
#include "dynamics/mesh/face_functions.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/frames/labels.hpp"

namespace espalier::dynamics::model {
namespace {

Vec3 reference_of_node(const FlexibleBody& body, Index node) {
  return Eigen::Map<const Vec3>(body.reference().data() + 3 * node * body.vertices_per_node());
}

/// Their vertices, each once. @param turning those that take part in the rotation: about their own mean, `centre`
std::vector<FrameVertex> vertices_of(const std::vector<HeldPoint>& points, const std::vector<double>& weights,
                                     const Vec3& centre, const std::vector<char>& turning) {
  std::vector<FrameVertex> vertices;
  std::map<Index, std::size_t> known;
  for (std::size_t k = 0; k < points.size(); ++k)
    for (const auto& [vertex, factor] : points[k].parts) {
      const double weight = factor * weights[k];
      const Vec3 arm = turning[k] != 0 ? Vec3(weight * (points[k].reference - centre)) : Vec3::Zero();
      const auto [it, fresh] = known.emplace(vertex, vertices.size());
      if (fresh) {
        vertices.push_back({vertex, weight, arm});
      } else {
        vertices[it->second].weight += weight;
        vertices[it->second].arm += arm;
      }
    }
  return vertices;
}

/// The mean of the points that are marked.
Vec3 mean_of(const std::vector<HeldPoint>& points, const std::vector<double>& weights,
             const std::vector<char>& marked) {
  Vec3 sum = Vec3::Zero();
  double all = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (marked[k] == 0) continue;
    sum += weights[k] * points[k].reference;
    all += weights[k];
  }
  return sum / all;
}

/// Two points for each node of a shell: by the length of its edges between the nodes, where these are a line along its
/// boundary; else as given.
std::vector<double> shares_of_length(const ShellSpec& shell, const std::vector<Index>& nodes,
                                     const std::vector<double>& given) {
  const Mesh& mesh = *shell.mesh;
  const std::vector<Index>& boundary = mesh.node_set("boundary");
  const auto on_line = [&](Index k) {
    return std::binary_search(nodes.begin(), nodes.end(), k) && std::binary_search(boundary.begin(), boundary.end(), k);
  };
  if (!std::all_of(nodes.begin(), nodes.end(), on_line)) return given;
  std::map<std::pair<Index, Index>, int> edges;  // between the nodes, with the number of their elements
  for (Index e = 0; e < mesh.element_count(); ++e) {
    const auto quad = mesh.element(e);
    for (std::size_t a = 0; a < 4; ++a)
      if (const Index p = quad[a], q = quad[(a + 1) % 4]; on_line(p) && on_line(q)) ++edges[std::minmax(p, q)];
  }
  std::map<Index, double> share;
  for (const auto& [edge, elements] : edges) {
    if (elements != 1) continue;
    const Point &a = mesh.nodes[at(edge.first)], &b = mesh.nodes[at(edge.second)];
    const double length = (Vec3(a[0], a[1], a[2]) - Vec3(b[0], b[1], b[2])).norm();
    share[edge.first] += length;
    share[edge.second] += length;
  }
  if (share.size() != nodes.size()) return given;
  std::vector<double> weights;
  for (const auto& [node, length] : share) weights.insert(weights.end(), 2, length);
  return weights;
}

/// About `most` of `count`, evenly spread as in thinned(); all where `most` is 0.
std::vector<char> marks_of(std::size_t count, int most) {
  std::vector<char> marks(count, 1);
  if (most <= 0 || count <= at(most)) return marks;
  const double share = most / static_cast<double>(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double x = static_cast<double>(k) * std::numbers::phi;
    marks[k] = x - std::floor(x) < share ? 1 : 0;
  }
  return marks;
}

}  // namespace

std::unique_ptr<FlexibleFrame> make_point_frame(const FlexibleBody& body, const HeldPoint& point) {
  return std::make_unique<FlexibleFrame>(body, vertices_of({point}, {1}, Vec3::Zero(), {0}));
}

std::vector<HeldPoint> FrameBuilder::points_of(const MarkerSpec& m, const BuiltBody& body) const {
  constexpr double kLeastApart = 0.01;
  const FlexibleBody& flexible = *body.flexible;
  const auto* shell = std::get_if<ShellSpec>(&body.spec.shape);
  std::vector<HeldPoint> points;
  for (const Index k : nodes_of(m, body)) {
    if (flexible.vertices_per_node() == 1) {
      points.push_back({fmt::format("node {}", body.mesh->node_label(k)), {{k, 1}}, reference_of_node(flexible, k)});
      continue;
    }
    if (shell == nullptr)
      throw std::invalid_argument(
          fmt::format("nodes of '{}' have places and slopes of their own: give one node", m.body));
    const Vec3 director = Eigen::Map<const Vec3>(flexible.reference().data() + 3 * (2 * k + 1));
    // The frame of very thin shells farther out, where the turn about an edge can be told from rounding.
    const double extent = shell->file ? flexible.size() : std::max(shell->x.norm(), shell->y.norm());
    const double apart = std::max(shell->thickness, kLeastApart * extent);
    for (const double side : {-0.5, 0.5}) {
      const double height = side * apart - shell->offset;  // about the node, which the offset is measured from
      points.push_back({fmt::format("node {}, {}", shell->mesh->node_label(k), side < 0 ? "bottom" : "top"),
                        {{2 * k, 1}, {2 * k + 1, height}},
                        reference_of_node(flexible, k) + height * director});
    }
  }
  return points;
}

std::vector<HeldPoint> FrameBuilder::held_points(const MarkerSpec& m, const BuiltBody& body) const {
  if (m.face.empty() && !m.bore && !m.by_nodes() && m.edge.empty())
    throw std::invalid_argument(
        "attach = \"rigid\" needs a face, an edge, a bore or a node set, whose nodes are to be one rigid piece");
  std::vector<HeldPoint> points = points_of(m, body);
  if (points.size() < 3) throw std::invalid_argument("a rigid piece needs three nodes that are not on a line");
  return points;
}

std::array<std::size_t, 3> FrameBuilder::base_points(const std::vector<HeldPoint>& points) {
  const auto farthest = [&](const auto& distance) {
    std::size_t best = 0;
    for (std::size_t k = 1; k < points.size(); ++k)
      if (distance(points[best].reference) < distance(points[k].reference)) best = k;
    return best;
  };
  const std::size_t first = farthest([&](const Vec3& x) { return (x - points.front().reference).norm(); });
  const Vec3 from = points[first].reference;
  const std::size_t second = farthest([&](const Vec3& x) { return (x - from).norm(); });
  const Vec3 line = points[second].reference - from;
  const std::size_t third = farthest([&](const Vec3& x) { return (x - from).cross(line).norm(); });
  return {first, second, third};
}

std::pair<std::unique_ptr<FlexibleFrame>, Vec3> FrameBuilder::make_base(const MarkerSpec& m, const BuiltBody& body,
                                                                        const std::vector<HeldPoint>& points) {
  std::vector<HeldPoint> base;
  Vec3 centre = Vec3::Zero();
  for (const std::size_t k : base_points(points)) {
    centre += points[k].reference / 3;
    base.push_back(points[k]);
  }
  const Mat3 axes = m.global ? Mat3(body.spec.rotation.transpose() * m.axes) : m.axes;
  return {std::make_unique<FlexibleFrame>(*body.flexible,
                                          vertices_of(base, {1.0 / 3, 1.0 / 3, 1.0 / 3}, centre, {1, 1, 1}), axes),
          centre};
}

namespace {

/// The shares of nodes of a solid, ascending: the integrals of their shape functions over faces.
std::vector<double> shares_of_area(const Mesh& mesh, const std::string& face, const std::vector<Index>& nodes) {
  const std::map<Index, double> shares = area_weights(mesh, mesh.face_set(face));
  std::vector<double> weights;
  for (const Index node : nodes) {
    const auto found = shares.find(node);
    weights.push_back(found == shares.end() ? 0 : found->second);
  }
  return weights;
}

}  // namespace

std::unique_ptr<FlexibleFrame> FrameBuilder::make_mean(const MarkerSpec& m, const BuiltBody& body,
                                                       const Mat3& axes) const {
  const std::vector<HeldPoint> points = points_of(m, body);
  std::vector<double> weights(points.size(), 1);
  if (m.by_nodes() && !m.face.empty() && body.mesh) weights = shares_of_area(*body.mesh, m.face, nodes_of(m, body));
  const auto* shell = std::get_if<ShellSpec>(&body.spec.shape);
  if (shell != nullptr && shell->file)
    weights = shares_of_length(*shell, nodes_of(m, body), weights);
  else if (shell != nullptr && m.edge.size() == 1)  // by length: ends count half
    for (const std::size_t end : {std::size_t{0}, std::size_t{1}, points.size() - 2, points.size() - 1})
      weights[end] = 0.5;
  if (!m.weights.empty()) {
    const std::vector<double> of_nodes = weights_labelled(body, m.labels, m.weights);
    const std::size_t sides = points.size() / of_nodes.size();  // two of a shell
    for (std::size_t k = 0; k < weights.size(); ++k) weights[k] = of_nodes[k / sides];
  }
  double sum = 0;
  for (const double w : weights) sum += w;
  for (double& w : weights) w /= sum;
  // Nodes on a line have no rotation about it: a place alone, unless axes are asked for.
  double across = 0, along = 0;
  if (points.size() > 2) {
    const std::array<std::size_t, 3> base = base_points(points);
    const Vec3 line = points[base[1]].reference - points[base[0]].reference;
    along = line.squaredNorm();
    across = (points[base[2]].reference - points[base[0]].reference).cross(line).norm();
  }
  const bool turns = m.attach == Attach::mean || across > 1e-4 * along;
  // The rotation couples its nodes in one dense block: of large sets some make it, all the place.
  const std::vector<char> turning = turns ? marks_of(points.size(), m.most_nodes) : std::vector<char>(points.size(), 0);
  const Vec3 centre = turns ? mean_of(points, weights, turning) : Vec3::Zero();
  return std::make_unique<FlexibleFrame>(*body.flexible, vertices_of(points, weights, centre, turning), axes);
}

}  // namespace espalier::dynamics::model
