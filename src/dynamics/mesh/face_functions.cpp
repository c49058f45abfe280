#include "dynamics/mesh/face_functions.hpp"

#include <cmath>

#include "base/at.hpp"

namespace espalier::dynamics {

FaceFunctions face_functions(ElementType type, double r, double s) {
  FaceFunctions f;
  if (type == ElementType::tri3 || type == ElementType::tri6) {
    const double l[3] = {1 - r - s, r, s}, lr[3] = {-1, 1, 0}, ls[3] = {-1, 0, 1};
    for (std::size_t a = 0; a < 3; ++a) {
      const bool second = type == ElementType::tri6;
      f.n[a] = second ? l[a] * (2 * l[a] - 1) : l[a];
      f.r[a] = second ? (4 * l[a] - 1) * lr[a] : lr[a];
      f.s[a] = second ? (4 * l[a] - 1) * ls[a] : ls[a];
      if (!second) continue;
      const std::size_t b = (a + 1) % 3;
      f.n[3 + a] = 4 * l[a] * l[b];
      f.r[3 + a] = 4 * (lr[a] * l[b] + l[a] * lr[b]);
      f.s[3 + a] = 4 * (ls[a] * l[b] + l[a] * ls[b]);
    }
    return f;
  }
  const bool second = type == ElementType::quad8;
  constexpr double kR[4] = {-1, 1, 1, -1}, kS[4] = {-1, -1, 1, 1};
  for (std::size_t a = 0; a < 4; ++a) {
    const double x = 1 + kR[a] * r, y = 1 + kS[a] * s, z = kR[a] * r + kS[a] * s - 1;
    f.n[a] = 0.25 * x * y * (second ? z : 1);
    f.r[a] = 0.25 * kR[a] * y * (second ? z + x : 1);
    f.s[a] = 0.25 * kS[a] * x * (second ? z + y : 1);
  }
  if (!second) return f;
  for (const std::size_t a : {0U, 2U}) {  // on the edges s = -1 and s = 1
    const double y = 1 + kS[a] * s;
    f.n[4 + a] = 0.5 * (1 - r * r) * y;
    f.r[4 + a] = -r * y;
    f.s[4 + a] = 0.5 * (1 - r * r) * kS[a];
  }
  for (const std::size_t a : {1U, 3U}) {  // r = 1 and r = -1
    const double x = 1 + kR[a] * r;
    f.n[4 + a] = 0.5 * (1 - s * s) * x;
    f.r[4 + a] = 0.5 * (1 - s * s) * kR[a];
    f.s[4 + a] = -s * x;
  }
  return f;
}

namespace {

struct FacePoint {
  double r, s, weight;
};
constexpr double kFaceGauss = 0.7745966692414834;  // sqrt(3 / 5)
/// Gauss's 3 x 3 points, and the three of a triangle that are exact to second order.
constexpr FacePoint kQuadPoints[] = {
    {-kFaceGauss, -kFaceGauss, 25.0 / 81}, {0, -kFaceGauss, 40.0 / 81}, {kFaceGauss, -kFaceGauss, 25.0 / 81},
    {-kFaceGauss, 0, 40.0 / 81},           {0, 0, 64.0 / 81},           {kFaceGauss, 0, 40.0 / 81},
    {-kFaceGauss, kFaceGauss, 25.0 / 81},  {0, kFaceGauss, 40.0 / 81},  {kFaceGauss, kFaceGauss, 25.0 / 81}};
constexpr FacePoint kTrianglePoints[] = {
    {1.0 / 6, 1.0 / 6, 1.0 / 6}, {2.0 / 3, 1.0 / 6, 1.0 / 6}, {1.0 / 6, 2.0 / 3, 1.0 / 6}};

}  // namespace

std::map<Index, double> area_weights(const Mesh& mesh, std::span<const MeshFace> faces) {
  std::map<Index, double> weights;
  for (const MeshFace& face : faces) {
    const std::vector<Index> nodes = mesh.face_nodes(face);
    const ElementType type = shape_of(mesh.type(face.element)).faces[at(face.face)].type;
    const bool triangle = shape_of(type).corners == 3;
    for (const FacePoint& point : triangle ? std::span<const FacePoint>(kTrianglePoints) : kQuadPoints) {
      const FaceFunctions f = face_functions(type, point.r, point.s);
      Point r{}, s{};
      for (std::size_t a = 0; a < nodes.size(); ++a)
        for (std::size_t d = 0; d < 3; ++d) {
          r[d] += f.r[a] * mesh.nodes[at(nodes[a])][d];
          s[d] += f.s[a] * mesh.nodes[at(nodes[a])][d];
        }
      const double area =
          point.weight * std::hypot(r[1] * s[2] - r[2] * s[1], r[2] * s[0] - r[0] * s[2], r[0] * s[1] - r[1] * s[0]);
      for (std::size_t a = 0; a < nodes.size(); ++a) weights[nodes[a]] += area * f.n[a];
    }
  }
  return weights;
}

}  // namespace espalier::dynamics
