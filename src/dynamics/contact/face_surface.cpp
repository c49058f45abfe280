#include "dynamics/contact/face_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "dynamics/elements/line_point.hpp"
#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics::contact {
namespace {

/// The nearest point of a cubic: the best of several starts, by Newton for t . (x - y(xi)) = 0.
FaceProjection project_on_line(const SurfaceFace& line, const Vec3& x) {
  constexpr int kStarts = 9, kMostPasses = 30;
  constexpr double kClose = 1e-15, kFar = 1.5;
  FaceProjection p;
  double nearest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kStarts; ++k) {
    const double xi = -1 + 2.0 * k / (kStarts - 1), distance = (x - face_place(line, &xi).x).squaredNorm();
    if (distance < nearest) {
      nearest = distance;
      p.xi[0] = xi;
    }
  }
  for (int pass = 0; pass < kMostPasses; ++pass) {
    const FacePlace at = face_place(line, p.xi.data());
    const Vec3 d = x - at.x;
    const double metric = at.tangent[0].squaredNorm(), full = metric - face_bends(line, p.xi.data())[0].dot(d);
    const double step = at.tangent[0].dot(d) / (full > 0.1 * metric ? full : metric);
    p.xi[0] += step;
    if (!(std::abs(p.xi[0]) < kFar)) return p;
    if (std::abs(step) < kClose || (pass > 6 && std::abs(step) < 1e-12)) {
      p.outside = std::max(0.0, std::abs(p.xi[0]) - 1);
      return p;
    }
  }
  return p;
}

}  // namespace

std::vector<Index> SurfaceFace::all_rows() const {
  std::vector<Index> all;
  for (const NodeRows& node : rows)
    for (const Index first : {node.position, node.director})
      for (Index i = 0; i < 3 && first >= 0; ++i) all.push_back(first + i);
  return all;
}

bool are_neighbours(const SurfaceFace& a, const SurfaceFace& b) {
  if (a.element == b.element) return true;
  return std::any_of(a.names.begin(), a.names.end(),
                     [&](Index n) { return std::find(b.names.begin(), b.names.end(), n) != b.names.end(); });
}

FacePlace face_place(const SurfaceFace& face, const std::vector<Vec3>& nodes, const double* xi) {
  FacePlace p;
  const std::size_t n = nodes.size();
  std::array<double, 2 * kMostFaceNodes> slopes{};
  if (face.is_line()) {
    const Hermite h(xi[0], face.size);
    for (std::size_t a = 0; a < 4; ++a) {
      p.value[a] = h.n[a];
      slopes[a] = 0.5 * face.size * h.d[a];
    }
  } else {
    shape_values(face.type, xi, p.value.data());
    shape_gradients(face.type, xi, slopes.data());
  }
  for (std::size_t a = 0; a < n; ++a) {
    p.x += p.value[a] * nodes[a];
    for (std::size_t d = 0; d < 2; ++d) {
      p.slope[d][a] = slopes[d * n + a];
      p.tangent[d] += p.slope[d][a] * nodes[a];
    }
  }
  return p;
}

// Slopes are polynomials of degree two at most in each direction, so central differences of step 1/2 are exact.
std::array<Vec3, 3> face_bends(const SurfaceFace& face, const std::vector<Vec3>& nodes, const double* xi) {
  const auto tangents = [&](double d1, double d2) {
    const double at[2] = {xi[0] + d1, xi[1] + d2};
    if (face.is_line()) return face_place(face, nodes, at).tangent;
    std::array<double, 2 * kMostFaceNodes> slopes{};
    shape_gradients(face.type, at, slopes.data());
    std::array<Vec3, 2> t = {Vec3::Zero(), Vec3::Zero()};
    const std::size_t n = nodes.size();
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t d = 0; d < 2; ++d) t[d] += slopes[d * n + a] * nodes[a];
    return t;
  };
  constexpr double kHalf = 0.5;
  const auto ahead = tangents(kHalf, 0), behind = tangents(-kHalf, 0);
  if (face.is_line()) return {ahead[0] - behind[0], Vec3::Zero(), Vec3::Zero()};
  const auto left = tangents(0, kHalf), right = tangents(0, -kHalf);
  return {ahead[0] - behind[0], ahead[1] - behind[1], left[1] - right[1]};
}

// Spheres and slabs: around the mean of the nodes, and along the normal there. Shape functions of quadratic faces add
// up to less than twice the largest height of a node, also a tenth beyond the sides.
bool may_be_over(const SurfaceFace& face, const Vec3& x, double below, double above) {
  if (face.is_line()) return true;
  Vec3 middle = Vec3::Zero();
  for (const Vec3& node : face.x) middle += node;
  middle /= static_cast<double>(face.x.size());
  double square = 0;
  for (const Vec3& node : face.x) square = std::max(square, (node - middle).squaredNorm());
  const Vec3 to = x - middle;
  constexpr double kBeyond = 2;
  const double around = kBeyond * std::sqrt(square) + std::max(below, above);
  if (to.squaredNorm() > around * around) return false;
  const Vec3 normal = face.is_triangle() ? Vec3((face.x[1] - face.x[0]).cross(face.x[2] - face.x[0]))
                                         : Vec3((face.x[2] - face.x[0]).cross(face.x[3] - face.x[1]));
  const double length = normal.norm();
  double bulge = 0;
  for (const Vec3& node : face.x) bulge = std::max(bulge, std::abs(normal.dot(node - middle)));
  const double height = normal.dot(to);
  return height <= kBeyond * bulge + above * length && height >= -kBeyond * bulge - below * length;
}

// Newton for tangent_a . (x - x(xi)) = 0; second derivatives are those of a place nearby.
FaceProjection project_on_face(const SurfaceFace& face, const Vec3& x, const std::array<double, 2>* near) {
  constexpr int kMostPasses = 30;
  constexpr double kClose = 1e-15, kFar = 10, kNearby = 1e-2;
  if (face.is_line()) return project_on_line(face, x);
  FaceProjection p;
  const bool triangle = face.is_triangle();
  if (near != nullptr)
    p.xi = *near;
  else if (triangle)
    p.xi = {1.0 / 3, 1.0 / 3};
  bool converged = false;
  double moved = 1;
  std::array<Vec3, 3> bends = {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  for (int pass = 0; pass < kMostPasses && !converged; ++pass) {
    const FacePlace at = face_place(face, p.xi.data());
    const Vec3 d = x - at.x;
    const Eigen::Vector2d r(at.tangent[0].dot(d), at.tangent[1].dot(d));
    Eigen::Matrix2d metric;
    metric << at.tangent[0].squaredNorm(), at.tangent[0].dot(at.tangent[1]), at.tangent[0].dot(at.tangent[1]),
        at.tangent[1].squaredNorm();
    Eigen::Matrix2d k = metric;
    if (face.type != ElementType::tri3) {
      if (moved > kNearby) bends = face_bends(face, p.xi.data());
      k(0, 0) -= bends[0].dot(d);
      k(0, 1) -= bends[1].dot(d);
      k(1, 0) -= bends[1].dot(d);
      k(1, 1) -= bends[2].dot(d);
      if (!(k.determinant() > 0.1 * metric.determinant())) k = metric;  // far away: Gauss and Newton
    }
    const Eigen::Vector2d step = k.inverse() * r;
    p.xi[0] += step[0];
    p.xi[1] += step[1];
    if (!(std::abs(p.xi[0]) < kFar && std::abs(p.xi[1]) < kFar)) return p;
    moved = step.cwiseAbs().maxCoeff();
    converged = moved < kClose || (pass > 6 && moved < 1e-12);
  }
  if (!converged) return p;
  const double beyond = triangle ? std::max({-p.xi[0], -p.xi[1], p.xi[0] + p.xi[1] - 1})
                                 : std::max(std::abs(p.xi[0]), std::abs(p.xi[1])) - 1;
  p.outside = std::max(0.0, beyond);
  return p;
}

FaceSurface::FaceSurface(std::string name, const FlexibleBody& body, const Mesh& mesh, std::span<const MeshFace> faces)
    : name_(std::move(name)), body_(&body) {
  if (body.vertices_per_node() != 1)
    throw std::invalid_argument(fmt::format("'{}' is no solid; faces are those of solids", body.name()));
  const std::vector<MeshFace> all = faces.empty() ? mesh.boundary_faces() : std::vector<MeshFace>();
  for (const MeshFace& f : faces.empty() ? std::span<const MeshFace>(all) : faces) {
    if (!is_simulated_solid(mesh.type(f.element))) continue;
    SurfaceFace face;
    face.type = shape_of(mesh.type(f.element)).faces[static_cast<std::size_t>(f.face)].type;
    face.element = f.element;
    face.names = mesh.face_nodes(f);
    for (const Index n : face.names) {
      const double* p = body.reference().data() + 3 * n;
      face.reference.emplace_back(p[0], p[1], p[2]);
      face.places.push_back(body.configuration(n));
      face.rows.push_back({body.coordinate(n)});
    }
    add_face(std::move(face));
  }
  finish();
}

FaceSurface::FaceSurface(std::string name, const FlexibleBody& body, std::span<const std::array<Index, 4>> quads,
                         double thickness, ShellSides sides)
    : name_(std::move(name)), body_(&body) {
  if (body.vertices_per_node() != 2) throw std::invalid_argument(fmt::format("'{}' is no shell", body.name()));
  for (std::size_t e = 0; e < quads.size(); ++e)
    for (const double side : {1.0, -1.0}) {
      if (sides == (side > 0 ? ShellSides::bottom : ShellSides::top)) continue;
      SurfaceFace face;
      face.type = ElementType::quad4;
      face.element = static_cast<Index>(e);
      face.depth = 0.5 * thickness;
      std::array<Index, 4> nodes = quads[e];
      if (side < 0) std::swap(nodes[1], nodes[3]);  // anticlockwise seen from outside
      for (const Index n : nodes) {
        const double lift = 0.5 * side * thickness, *p = body.reference().data() + 6 * n;
        face.names.push_back(side > 0 ? n : n + body.nodes());
        face.reference.emplace_back(p[0] + lift * p[3], p[1] + lift * p[4], p[2] + lift * p[5]);
        face.places.push_back(body.configuration(2 * n));
        face.director_places.push_back(body.configuration(2 * n + 1));
        face.rows.push_back({body.coordinate(2 * n), body.coordinate(2 * n + 1), lift});
      }
      add_face(std::move(face));
    }
  finish();
}

FaceSurface::FaceSurface(std::string name, const FlexibleBody& body, double element_length, double radius,
                         int divisions)
    : name_(std::move(name)), body_(&body), divisions_(divisions) {
  const Index per_node = body.vertices_per_node();
  if (per_node == 1) throw std::invalid_argument(fmt::format("'{}' is no cable or beam", body.name()));
  if (!(radius > 0) || !(element_length > 0) || divisions < 1)
    throw std::invalid_argument("a line needs a radius, a length and divisions greater than 0");
  for (Index e = 0; e + 1 < body.nodes(); ++e) {
    SurfaceFace face;
    face.type = ElementType::line2;
    face.element = e;
    face.size = element_length;
    face.radius = face.depth = radius;
    for (const Index n : {e, e + 1})
      for (const Index vertex : {per_node * n, per_node * n + 1}) {
        const double* p = body.reference().data() + 3 * vertex;
        face.names.push_back(vertex == per_node * n ? n : -1);
        face.reference.emplace_back(p[0], p[1], p[2]);
        face.places.push_back(body.configuration(vertex));
        face.rows.push_back({body.coordinate(vertex)});
      }
    add_face(std::move(face));
  }
  finish();
}

void FaceSurface::add_face(SurfaceFace face) {
  if (!face.is_line()) {
    double area = 0;
    for (const QuadraturePoint& q : face_quadrature(face.type))
      area += q.weight * face_place(face, face.reference, q.xi.data()).normal_area().norm();
    face.size = std::sqrt(area);
    face.depth = face.depth > 0 ? std::min(face.depth, 0.5 * face.size) : 0.5 * face.size;
  }
  mean_size_ += face.size;
  face.x = face.v = face.reference;
  for (const Index node : face.names)
    if (node >= 0) nodes_.push_back(node);
  faces_.push_back(std::move(face));
}

void FaceSurface::finish() {
  if (faces_.empty())
    throw std::invalid_argument(
        fmt::format("the surface '{}' of '{}' is empty: it has no faces", name_, body_->name()));
  mean_size_ /= static_cast<double>(faces_.size());
  sort_unique(nodes_);
  boxes_.resize(faces_.size());
}

void FaceSurface::limit_depths(const FaceSurface& other) {
  std::vector<Box> boxes;
  for (const SurfaceFace& face : other.faces_) {
    boxes.emplace_back();
    for (const Vec3& x : face.reference) boxes.back().add(x);
  }
  BoxTree tree;
  tree.build(boxes);
  for (SurfaceFace& face : faces_) {
    const double third = 1.0 / 3;
    const double xi[2] = {face.is_triangle() ? third : 0, face.is_triangle() ? third : 0};
    const FacePlace middle = face_place(face, face.reference, xi);
    const Vec3 inwards = -middle.normal_area().normalized();
    Box below;
    below.add(middle.x);
    below.add(Vec3(middle.x + 2 * face.depth * inwards));
    tree.query(below, [&](Index f) {
      SurfaceFace unstressed = other.faces_[static_cast<std::size_t>(f)];
      unstressed.x = unstressed.reference;
      const FaceProjection p = project_on_face(unstressed, middle.x);
      constexpr double kBeyond = 0.1;
      if (p.outside > kBeyond) return;
      const FacePlace there = face_place(unstressed, p.xi.data());
      const double thickness = inwards.dot(there.x - middle.x);
      if (there.normal_area().dot(inwards) > 0 && thickness > 0) face.depth = std::min(face.depth, 0.5 * thickness);
    });
  }
}

void FaceSurface::move_to(ConstSpan q, ConstSpan v) {
  const auto at = [](ConstSpan numbers, Index first) {
    const double* x = &numbers[static_cast<std::size_t>(first)];
    return Vec3(x[0], x[1], x[2]);
  };
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    SurfaceFace& face = faces_[f];
    for (std::size_t a = 0; a < face.places.size(); ++a) {
      const NodeRows& rows = face.rows[a];
      face.x[a] = at(q, face.places[a]);
      face.v[a] = v.empty() ? Vec3(Vec3::Zero()) : at(v, rows.position);
      if (rows.director < 0) continue;
      face.x[a] += rows.lift * at(q, face.director_places[a]);
      if (!v.empty()) face.v[a] += rows.lift * at(v, rows.director);
    }
    Box box;
    if (face.is_line()) {  // that of the control points of its cubic
      const double third = face.size / 3;
      for (const Vec3& x :
           {face.x[0], Vec3(face.x[0] + third * face.x[1]), Vec3(face.x[2] - third * face.x[3]), face.x[2]})
        box.add(x);
      box.widen(face.radius);
    } else {
      for (const Vec3& x : face.x) box.add(x);
    }
    if (!(box.low.array() <= box.high.array()).all())
      throw Error(StatusCode::singular, "a face of the surface '" + name_ + "' is at a place that is no number");
    boxes_[f] = box;
  }
  tree_stale_ = true;
}

const BoxTree& FaceSurface::tree() {
  if (tree_stale_) tree_.refit(boxes_);
  tree_stale_ = false;
  return tree_;
}

}  // namespace espalier::dynamics::contact
