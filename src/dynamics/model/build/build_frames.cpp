#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>

#include "dense/dense.hpp"
#include "dynamics/bodies/carried_frame.hpp"
#include "dynamics/bodies/reduced_frame.hpp"
#include "dynamics/model/assembly/line_body.hpp"
#include "dynamics/model/assembly/line_elements.hpp"
#include "dynamics/model/assembly/shell_body.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/frames/labels.hpp"

namespace espalier::dynamics::model {
namespace {

Vec3 reference_node(const FlexibleBody& body, Index node) {
  const double* x =
      body.reference().data() + 3 * static_cast<std::size_t>(node) * static_cast<std::size_t>(body.vertices_per_node());
  return {x[0], x[1], x[2]};
}

/// In how many ways a marker says where on a flexible body it is.
int ways_of(const MarkerSpec& m) {
  const bool weighed = m.by_nodes() && m.attach == Attach::mean;  // the face says how much
  return (m.node ? 1 : 0) + (m.along.empty() ? 0 : 1) + (m.near && m.face.empty() ? 1 : 0) +
         (m.face.empty() || weighed ? 0 : 1) + (m.by_nodes() ? 1 : 0) + (m.bore ? 1 : 0) + (m.edge.empty() ? 0 : 1);
}

void check_ways(const MarkerSpec& m) {
  if (ways_of(m) != 1)
    throw std::invalid_argument(
        fmt::format("'{}' is flexible: say where with one of node = LABEL, near = [x, y, z], along = SHARE, face = "
                    "\"SET\", nodes = "
                    "\"SET\" or [LABEL, LABEL, ...], edge = [\"FACE\", \"FACE\"], bore = {{ point, axis, radius }}",
                    m.body));
}

/// About `most` entries of a list, evenly spread. Steps by the golden ratio: a constant step would fall into step with
/// the rows of a structured mesh (60 of 20 x 20 faces then lay in three columns).
template <class T>
std::vector<T> thinned(const std::vector<T>& list, std::size_t most) {
  if (list.size() <= most) return list;
  const double share = static_cast<double>(most) / static_cast<double>(list.size());
  std::vector<T> result;
  for (std::size_t k = 0; k < list.size(); ++k)
    if (const double x = static_cast<double>(k) * std::numbers::phi; x - std::floor(x) < share)
      result.push_back(list[k]);
  return result;
}

/// Outer faces whose corners all lie on the cylinder, to within a twentieth of its radius.
std::vector<MeshFace> faces_of_bore(const BuiltBody& body, const MarkerSpec::Bore& bore) {
  std::vector<MeshFace> faces = body.mesh->boundary_faces();
  std::erase_if(faces, [&](const MeshFace& face) {
    const auto nodes = body.mesh->face_nodes(face);
    return std::any_of(nodes.begin(), nodes.end(), [&](Index node) {
      const Vec3 arm = reference_node(*body.flexible, node) - bore.point;
      const double along = arm.dot(bore.axis), radius = (arm - along * bore.axis).norm();
      return std::abs(radius - bore.radius) > 0.05 * bore.radius ||
             (bore.length > 0 && std::abs(along) > 0.5 * bore.length * (1 + 1e-6));
    });
  });
  if (faces.empty())
    throw std::invalid_argument(fmt::format("no outer face of '{}' lies on the cylinder 'bore'", body.spec.name));
  return faces;
}

/// Share of each node in the area of the faces (each face in equal parts); the weights add up to 1.
std::map<Index, double> area_weights(const FlexibleBody& body, const Mesh& mesh, const std::vector<MeshFace>& faces) {
  std::map<Index, double> weights;
  double total = 0;
  for (const MeshFace& face : faces) {
    const auto nodes = mesh.face_nodes(face);
    const std::size_t corners = nodes.size() > 4 ? nodes.size() / 2 : nodes.size();
    Vec3 area = Vec3::Zero();
    for (std::size_t k = 0; k < corners; ++k)
      area += 0.5 * reference_node(body, nodes[k]).cross(reference_node(body, nodes[(k + 1) % corners]));
    total += area.norm();
    for (const Index n : nodes) weights[n] += area.norm() / static_cast<double>(nodes.size());
  }
  for (auto& [node, weight] : weights) weight /= total;
  return weights;
}

Vec3 area_mean(const FlexibleBody& body, const Mesh& mesh, const std::vector<MeshFace>& faces) {
  Vec3 mean = Vec3::Zero();
  for (const auto& [node, weight] : area_weights(body, mesh, faces)) mean += weight * reference_node(body, node);
  return mean;
}

/// A faceted bore has its area-weighted mean beside its axis. The weights are changed as little as possible (least
/// squares relative to themselves) so that the mean is `point`: w (1 + mu . z), z = [1; X - point].
std::vector<FrameVertex> centred_vertices(const FlexibleBody& body, const Mesh& mesh,
                                          const std::vector<MeshFace>& faces, const Vec3& point) {
  const std::map<Index, double> weights = area_weights(body, mesh, faces);
  double size = 0;
  for (const auto& [node, w] : weights) size = std::max(size, (reference_node(body, node) - point).norm());
  const auto basis = [&](Index node) {
    const Vec3 arm = (reference_node(body, node) - point) / size;
    return Eigen::Vector4d(1, arm.x(), arm.y(), arm.z());
  };
  Eigen::Matrix4d gram = Eigen::Matrix4d::Zero();
  for (const auto& [node, w] : weights) gram += w * basis(node) * basis(node).transpose();
  // A flat set has no extension along its normal: least norm there.
  const Eigen::Vector4d factor = dense::least_squares(gram, Eigen::Vector4d::UnitX(), 1e-10);
  if ((gram * factor - Eigen::Vector4d::UnitX()).norm() > 1e-6)
    throw std::invalid_argument("'point' lies outside of the plane of the face set; leave it out or correct it");
  std::vector<FrameVertex> vertices;
  for (const auto& [node, w] : weights) {
    const double changed = w * factor.dot(basis(node));
    if (!(changed > 0))
      throw std::invalid_argument("'point' is too far from the middle of the face set to be its mean");
    vertices.push_back({node, changed, changed * (reference_node(body, node) - point)});
  }
  return vertices;
}

/// Where the text wants the mean to be, in mesh coordinates.
std::optional<Vec3> wanted_mean(const MarkerSpec& m, const BuiltBody& body) {
  if (!m.point_given) return std::nullopt;
  return m.global ? Vec3(body.spec.rotation.transpose() * (m.point - body.spec.position)) : m.point;
}

/// From the mean of nodes that carry a point beside it, in the axes of their frame.
std::optional<Vec3> arm_of(const MarkerSpec& m, const BuiltBody& body, const FlexibleFrame& frame) {
  if (!m.by_nodes() || !m.point_given || !frame.has_rotation()) return std::nullopt;
  Vec3 mean = Vec3::Zero();
  for (const FrameVertex& v : frame.vertices())
    mean += v.weight * Eigen::Map<const Vec3>(body.flexible->reference().data() + 3 * v.vertex);
  return Vec3(frame.axes().transpose() * (*wanted_mean(m, body) - mean));
}

/// The node at a share of the length of a beam or cable, or those between two.
std::vector<Index> nodes_along(const MarkerSpec& m, const BuiltBody& body) {
  if (line_chains(body).empty() || line_file(body) != nullptr)
    throw std::invalid_argument(fmt::format(
        "'along' is of beams and cables that are given by their dimensions; say otherwise where on '{}'", m.body));
  const auto last = static_cast<double>(body.flexible->nodes() - 1);
  if (m.along.size() == 1) return {static_cast<Index>(std::lround(m.along[0] * last))};
  constexpr double kSlack = 1e-9;
  std::vector<Index> nodes;
  for (Index k = 0; k < body.flexible->nodes(); ++k)
    if (k >= m.along[0] * last - kSlack && k <= m.along[1] * last + kSlack) nodes.push_back(k);
  if (nodes.empty()) throw std::invalid_argument("no node lies there along the line: it needs more elements");
  return nodes;
}

}  // namespace

void FrameBuilder::note_initial_state() {
  std::size_t nq = 0, nv = 0;
  for (const auto& component : built_.system.components()) {
    nq += static_cast<std::size_t>(component->sizes().configuration);
    nv += static_cast<std::size_t>(component->sizes().velocity);
  }
  q_.assign(nq, 0.0);
  v_.assign(nv, 0.0);
  for (const auto& component : built_.system.components()) component->initial(q_, v_);
}

void FrameBuilder::unknown_body(const std::string& name, const Place& place) const {
  if (name == "ground") fail(place, "the ground is no body here: name one of the model's");
  std::vector<std::string> names = {"ground"};
  for (const BuiltBody& b : built_.bodies) names.push_back(b.spec.name);
  fail(place, fmt::format("unknown body '{}'{}", name, suggestion(name, names)));
}

const MarkerSpec& FrameBuilder::resolve(const MarkerSpec& marker) const {
  std::set<std::string> seen;
  const MarkerSpec* at = &marker;
  if (!marker.name.empty()) seen.insert(marker.name);
  std::string way = marker.name;
  while (!at->reference.empty()) {
    const auto it = model_.markers.find(at->reference);
    if (it == model_.markers.end()) {
      std::vector<std::string> names;
      for (const auto& [name, m] : model_.markers) names.push_back(name);
      fail(at->place, fmt::format("unknown marker '{}'{}", at->reference, suggestion(at->reference, names)));
    }
    way += (way.empty() ? "" : " -> ") + at->reference;
    if (!seen.insert(at->reference).second)
      fail(at->place, fmt::format("the markers refer to each other in a circle: {}; give one of them a body", way));
    at = &it->second;
  }
  return *at;
}

std::unique_ptr<Frame> FrameBuilder::make(const MarkerSpec& marker) const {
  const MarkerSpec& m = resolve(marker);
  if (m.body == "ground") return std::make_unique<GroundFrame>(m.point, m.axes);
  const BuiltBody* body = built_.body(m.body);
  if (body == nullptr) unknown_body(m.body, m.place);
  std::unique_ptr<Frame> frame;
  at_place(m.place, [&] {
    if (body->flexible != nullptr && body->reduced == nullptr && m.attach == Attach::rigid) {
      frame = make_rigid(m, *body);
    } else if (body->flexible != nullptr) {
      std::unique_ptr<FlexibleFrame> nodal = make_nodal(m, *body);
      const std::optional<Vec3> arm = arm_of(m, *body, *nodal);
      if (body->reduced != nullptr)
        frame = std::make_unique<ReducedFrame>(*body->reduced, *nodal);
      else
        frame = std::move(nodal);
      if (arm) frame = std::make_unique<CarriedFrame>(std::move(frame), *arm, Mat3::Identity());
    } else if (body->point != nullptr) {
      if (ways_of(m) > 0 || (m.point_given && !m.global))
        throw std::invalid_argument(fmt::format("'{}' is a point mass: the body alone says where", m.body));
      frame = std::make_unique<PointFrame>(*body->point);
    } else {
      if (ways_of(m) > 0)
        throw std::invalid_argument(fmt::format("'{}' is a rigid body: give a 'point', not a node or a face", m.body));
      frame = m.global ? frame_at(*body->rigid, m.point, m.axes)
                       : std::make_unique<RigidFrame>(*body->rigid, m.point, m.axes);
    }
  });
  return frame;
}

FrameMotion FrameBuilder::initial_motion(const MarkerSpec& marker) const {
  FrameMotion motion;
  make(marker)->motion(q_, v_, motion);
  return motion;
}

Index FrameBuilder::node(const MarkerSpec& m, const BuiltBody& body) const {
  const FlexibleBody& flexible = *body.flexible;
  if (!m.along.empty()) {
    const std::vector<Index> nodes = nodes_along(m, body);
    if (nodes.size() > 1) throw std::invalid_argument("'along' names several nodes: one is needed here, along = 0.5");
    return nodes.front();
  }
  if (m.near) {
    Index best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (Index k = 0; k < flexible.nodes(); ++k) {
      const double d = (reference_node(flexible, k) - *m.near).squaredNorm();
      if (d < least) {
        least = d;
        best = k;
      }
    }
    return best;
  }
  return nodes_labelled(body, {*m.node}).front();
}

std::unique_ptr<FlexibleFrame> FrameBuilder::make_nodal(const MarkerSpec& m, const BuiltBody& body) const {
  check_ways(m);
  const Mat3 axes = m.global ? Mat3(body.spec.rotation.transpose() * m.axes) : m.axes;
  if ((!m.face.empty() && !m.by_nodes()) || m.bore) return make_face(m, body, axes);
  const FlexibleBody& flexible = *body.flexible;
  if (!m.edge.empty() || (m.by_nodes() && (m.attach == Attach::mean || !body.mesh))) return make_mean(m, body, axes);
  if (m.by_nodes()) {
    const std::vector<Index> set = nodes_of(m, body);
    std::vector<double> weights(set.size(), 1);
    if (!m.weights.empty()) weights = weights_labelled(body, m.labels, m.weights);
    const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
    std::vector<FrameVertex> vertices;
    for (std::size_t k = 0; k < set.size(); ++k) vertices.push_back({set[k], weights[k] / sum, Vec3::Zero()});
    return std::make_unique<FlexibleFrame>(flexible, std::move(vertices));
  }
  const Index k = node(m, body);
  const auto* substructure = std::get_if<SubstructureSpec>(&body.spec.shape);
  const bool turns = substructure == nullptr || substructure->nodes[static_cast<std::size_t>(k)].components == 6;
  if (std::holds_alternative<ShellSpec>(body.spec.shape)) return shell_node_frame(body, k, axes);
  return flexible.vertices_per_node() == 4 && turns ? make_beam_frame(flexible, k, axes) : make_node_frame(flexible, k);
}

std::vector<MeshFace> FrameBuilder::faces_of(const MarkerSpec& m, const BuiltBody& body) const {
  if (!body.mesh)
    throw std::invalid_argument(fmt::format("'{}' has no face sets; give a node, or an edge of a shell", m.body));
  if (!m.bore && !body.mesh->face_sets.contains(m.face) && body.mesh->node_sets.contains(m.face))
    throw std::invalid_argument(
        fmt::format("'{}' is a set of nodes, and no outer face of '{}' has all its nodes in it; write nodes = \"{}\"",
                    m.face, m.body, m.face));
  std::vector<MeshFace> faces = m.bore ? faces_of_bore(body, *m.bore) : body.mesh->face_set(m.face);
  if (m.radius > 0) {
    if (!m.near) throw std::invalid_argument("'radius' needs 'near', the centre");
    std::erase_if(faces, [&](const MeshFace& face) {
      Vec3 centre = Vec3::Zero();
      const auto nodes = body.mesh->face_nodes(face);
      for (const Index k : nodes) centre += reference_node(*body.flexible, k) / static_cast<double>(nodes.size());
      return (centre - *m.near).norm() > m.radius;
    });
    if (faces.empty())
      throw std::invalid_argument(fmt::format("no face of '{}' lies within {} of 'near'", m.face, m.radius));
  }
  return faces;
}

std::vector<Index> FrameBuilder::nodes_of(const MarkerSpec& m, const BuiltBody& body) const {
  check_ways(m);
  const auto* shell = std::get_if<ShellSpec>(&body.spec.shape);
  std::vector<Index> nodes;
  const auto keep_common = [&](std::vector<Index> next) {
    std::sort(next.begin(), next.end());
    std::erase_if(nodes, [&](Index k) { return !std::binary_search(next.begin(), next.end(), k); });
  };
  if (!m.edge.empty()) {
    if (shell == nullptr && !body.mesh) throw std::invalid_argument(fmt::format("'{}' has no edges", m.body));
    if (shell == nullptr && m.edge.size() < 2)
      throw std::invalid_argument("an edge of a solid is what faces have in common: edge = [\"x0\", \"z1\"]");
    const auto side = [&](const std::string& name) {
      return shell != nullptr ? shell_nodes(body, name) : body.mesh->nodes_of_faces(body.mesh->face_set(name));
    };
    nodes = side(m.edge.front());
    for (const std::string& name : m.edge) keep_common(side(name));
    if (nodes.empty()) throw std::invalid_argument("these faces have no node in common: there is no such edge");
  } else if (!m.labels.empty()) {
    nodes = nodes_labelled(body, m.labels);
  } else if (!m.nodes.empty()) {
    if (named_mesh(body) == nullptr)
      throw std::invalid_argument(
          fmt::format("'{}' has no node sets; give a node, or of a beam or cable 'along'", m.body));
    nodes = shell != nullptr ? shell_nodes(body, m.nodes) : named_mesh(body)->node_set(m.nodes);
  } else if (!m.along.empty()) {
    nodes = nodes_along(m, body);
  } else if (!m.face.empty() || m.bore) {
    const std::vector<MeshFace> faces = faces_of(m, body);
    nodes = body.mesh->nodes_of_faces(faces);
  } else {
    nodes = {node(m, body)};
  }
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

std::unique_ptr<Frame> FrameBuilder::make_rigid(const MarkerSpec& m, const BuiltBody& body) const {
  const std::vector<HeldPoint> points = held_points(m, body);
  auto [base, centre] = make_base(m, body, points);
  Vec3 origin = Vec3::Zero();
  if (const std::optional<Vec3> wanted = wanted_mean(m, body)) {
    origin = *wanted;
  } else if (!m.face.empty() || m.bore) {
    origin = area_mean(*body.flexible, *body.mesh, faces_of(m, body));
  } else {
    for (const HeldPoint& point : points) origin += point.reference / static_cast<double>(points.size());
  }
  const Vec3 offset = base->axes().transpose() * (origin - centre);
  return std::make_unique<CarriedFrame>(std::move(base), offset, Mat3::Identity());
}

std::unique_ptr<FlexibleFrame> FrameBuilder::make_face(const MarkerSpec& m, const BuiltBody& body,
                                                       const Mat3& axes) const {
  std::vector<MeshFace> faces = faces_of(m, body);
  std::optional<Vec3> mean = wanted_mean(m, body);
  // The rotation couples all nodes of the frame in one dense block, so large sets are thinned out; their mean stays.
  if (const std::size_t nodes = body.mesh->nodes_of_faces(faces).size(), most = static_cast<std::size_t>(m.most_nodes);
      most > 0 && nodes > most) {
    if (!mean) mean = area_mean(*body.flexible, *body.mesh, faces);
    faces = thinned(faces, std::max<std::size_t>(4, most / body.mesh->face_nodes(faces.front()).size()));
  }
  if (!mean) return make_face_frame(*body.flexible, *body.mesh, faces, axes);
  return std::make_unique<FlexibleFrame>(*body.flexible, centred_vertices(*body.flexible, *body.mesh, faces, *mean),
                                         axes);
}

}  // namespace espalier::dynamics::model
