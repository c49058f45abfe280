#include "dynamics/contact/face_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics::contact {
namespace {

bool is_triangle(ElementType type) { return type == ElementType::tri3 || type == ElementType::tri6; }

}  // namespace

std::vector<Index> SurfaceFace::all_rows() const {
  std::vector<Index> all;
  for (const Index first : rows)
    for (Index i = 0; i < 3; ++i) all.push_back(first + i);
  return all;
}

FacePlace face_place(ElementType type, const std::vector<Vec3>& nodes, const double* xi) {
  FacePlace p;
  const std::size_t n = nodes.size();
  std::array<double, 2 * kMostFaceNodes> slopes{};
  shape_values(type, xi, p.value.data());
  shape_gradients(type, xi, slopes.data());
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
std::array<Vec3, 3> face_bends(ElementType type, const std::vector<Vec3>& nodes, const double* xi) {
  const auto tangent = [&](double d1, double d2, std::size_t d) {
    const double at[2] = {xi[0] + d1, xi[1] + d2};
    return face_place(type, nodes, at).tangent[d];
  };
  constexpr double kHalf = 0.5;
  return {tangent(kHalf, 0, 0) - tangent(-kHalf, 0, 0), tangent(0, kHalf, 0) - tangent(0, -kHalf, 0),
          tangent(0, kHalf, 1) - tangent(0, -kHalf, 1)};
}

// Newton for tangent_a . (x - x(xi)) = 0.
FaceProjection project_on_face(const SurfaceFace& face, const Vec3& x) {
  constexpr int kMostPasses = 30;
  constexpr double kClose = 1e-15, kFar = 10;
  FaceProjection p;
  const bool triangle = is_triangle(face.type);
  if (triangle) p.xi = {1.0 / 3, 1.0 / 3};
  bool converged = false;
  for (int pass = 0; pass < kMostPasses && !converged; ++pass) {
    const FacePlace at = face_place(face.type, face.x, p.xi.data());
    const Vec3 d = x - at.x;
    const Eigen::Vector2d r(at.tangent[0].dot(d), at.tangent[1].dot(d));
    Eigen::Matrix2d metric;
    metric << at.tangent[0].squaredNorm(), at.tangent[0].dot(at.tangent[1]), at.tangent[0].dot(at.tangent[1]),
        at.tangent[1].squaredNorm();
    Eigen::Matrix2d k = metric;
    if (face.type != ElementType::tri3) {
      const auto bends = face_bends(face.type, face.x, p.xi.data());
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
    converged = step.cwiseAbs().maxCoeff() < kClose || (pass > 6 && step.cwiseAbs().maxCoeff() < 1e-12);
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
      face.rows.push_back(body.coordinate(n));
    }
    double area = 0;
    for (const QuadraturePoint& q : face_quadrature(face.type))
      area += q.weight * face_place(face.type, face.reference, q.xi.data()).normal_area().norm();
    face.size = std::sqrt(area);
    mean_size_ += face.size;
    face.x = face.v = face.reference;
    nodes_.insert(nodes_.end(), face.names.begin(), face.names.end());
    faces_.push_back(std::move(face));
  }
  if (faces_.empty())
    throw std::invalid_argument(fmt::format("the surface '{}' of '{}' is empty: it has no faces", name_, body.name()));
  mean_size_ /= static_cast<double>(faces_.size());
  sort_unique(nodes_);
  boxes_.resize(faces_.size());
}

void FaceSurface::move_to(ConstSpan q, ConstSpan v) {
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    SurfaceFace& face = faces_[f];
    Box box;
    for (std::size_t a = 0; a < face.places.size(); ++a) {
      const double* x = &q[static_cast<std::size_t>(face.places[a])];
      face.x[a] = {x[0], x[1], x[2]};
      box.add(face.x[a]);
      if (v.empty()) {
        face.v[a].setZero();
      } else {
        const double* y = &v[static_cast<std::size_t>(face.rows[a])];
        face.v[a] = {y[0], y[1], y[2]};
      }
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
