#include "dynamics/model/equations/nearest_face.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/mesh/face_functions.hpp"

namespace espalier::dynamics::model {

NearestFace::NearestFace(const Mesh& mesh, const std::vector<MeshFace>& faces,
                         const std::function<Vec3(Index)>& place) {
  for (const MeshFace& f : faces) {
    const ElementShape& shape = shape_of(mesh.type(f.element));
    add(shape.faces[at(f.face)].type, mesh.face_nodes(f), place);
    Face& face = faces_.back();
    for (const Index node : mesh.element(f.element).first(at(shape.corners)))
      if (std::find(face.nodes.begin(), face.nodes.end(), node) == face.nodes.end()) face.behind.push_back(node);
  }
}

NearestFace::NearestFace(std::span<const std::array<Index, 4>> quads, const std::function<Vec3(Index)>& place) {
  for (const auto& quad : quads) add(ElementType::quad4, {quad.begin(), quad.end()}, place);
}

void NearestFace::add(ElementType type, std::vector<Index> nodes, const std::function<Vec3(Index)>& place) {
  Face face{type, std::move(nodes), {}, Vec3::Zero(), 0, {}};
  for (const Index n : face.nodes) {
    face.places.push_back(place(n));
    face.centre += face.places.back() / static_cast<double>(face.nodes.size());
  }
  for (const Vec3& x : face.places) face.radius = std::max(face.radius, (x - face.centre).norm());
  faces_.push_back(std::move(face));
}

/// Gauss and Newton's steps in the face's two coordinates, kept on the face.
FacePoint NearestFace::project(const Face& face, const Vec3& point) {
  constexpr int kSteps = 50;
  constexpr double kRest = 1e-15;
  const bool triangle = shape_of(face.type).corners == 3;
  double r = triangle ? 1.0 / 3 : 0, s = r;
  FaceFunctions f;
  Vec3 x;
  const auto evaluate = [&](Vec3& by_r, Vec3& by_s) {
    f = face_functions(face.type, r, s);
    x.setZero();
    by_r.setZero();
    by_s.setZero();
    for (std::size_t a = 0; a < face.places.size(); ++a) {
      x += f.n[a] * face.places[a];
      by_r += f.r[a] * face.places[a];
      by_s += f.s[a] * face.places[a];
    }
  };
  Vec3 xr, xs;
  for (int step = 0; step < kSteps; ++step) {
    evaluate(xr, xs);
    const Vec3 d = point - x;
    const double a = xr.dot(xr), b = xr.dot(xs), c = xs.dot(xs), u = xr.dot(d), v = xs.dot(d), det = a * c - b * b;
    if (!(det > 0)) break;
    double to_r = r + (c * u - b * v) / det, to_s = s + (a * v - b * u) / det;
    if (triangle) {
      to_r = std::clamp(to_r, 0.0, 1.0);
      to_s = std::clamp(to_s, 0.0, 1.0);
      if (const double over = to_r + to_s - 1; over > 0) {
        to_r = std::clamp(to_r - 0.5 * over, 0.0, 1.0);
        to_s = 1 - to_r;
      }
    } else {
      to_r = std::clamp(to_r, -1.0, 1.0);
      to_s = std::clamp(to_s, -1.0, 1.0);
    }
    const double moved = std::abs(to_r - r) + std::abs(to_s - s);
    r = to_r;
    s = to_s;
    if (moved < kRest) break;
  }
  evaluate(xr, xs);
  FacePoint out;
  for (std::size_t a = 0; a < face.nodes.size(); ++a) {
    out.weights.emplace_back(face.nodes[a], f.n[a]);
    out.slopes[0].push_back(f.r[a]);
    out.slopes[1].push_back(f.s[a]);
  }
  out.tangents = {xr, xs};
  out.behind = face.behind;
  out.distance = (point - x).norm();
  out.extent = 2 * face.radius;
  return out;
}

FacePoint NearestFace::nearest(const Vec3& point, Index without) const {
  FacePoint best;
  best.distance = std::numeric_limits<double>::infinity();
  for (const Face& face : faces_) {
    if ((point - face.centre).norm() - face.radius >= best.distance) continue;
    if (without >= 0 && std::find(face.nodes.begin(), face.nodes.end(), without) != face.nodes.end()) continue;
    if (FacePoint found = project(face, point); found.distance < best.distance) best = std::move(found);
  }
  return best;
}

}  // namespace espalier::dynamics::model
