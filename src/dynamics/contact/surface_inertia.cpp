#include "dynamics/contact/surface_inertia.hpp"

#include <fmt/format.h>

#include <map>

namespace espalier::dynamics::contact {
namespace {

/// The rim of an open surface: its edges from vertex to vertex.
std::string hole_of(const TriangleSurface& surface) {
  std::multimap<Index, const TriangleSurface::Edge*> at;
  std::size_t rims = 0;
  const TriangleSurface::Edge* first = nullptr;
  for (const auto& edge : surface.edges()) {
    if (edge.right >= 0) continue;
    ++rims;
    if (first == nullptr) first = &edge;
    at.emplace(edge.a, &edge);
    at.emplace(edge.b, &edge);
  }
  // Along the rim until nothing is left of it.
  Vec3 middle = Vec3::Zero();
  std::size_t count = 0;
  for (Index vertex = first->a; true;) {
    const auto next = at.find(vertex);
    if (next == at.end()) break;
    const TriangleSurface::Edge* edge = next->second;
    middle += 0.5 * (surface.points()[static_cast<std::size_t>(edge->a)] +
                     surface.points()[static_cast<std::size_t>(edge->b)]);
    ++count;
    for (const Index end : {edge->a, edge->b})
      for (auto it = at.lower_bound(end); it != at.upper_bound(end);)
        it = it->second == edge ? at.erase(it) : std::next(it);
    vertex = edge->a == vertex ? edge->b : edge->a;
  }
  middle /= static_cast<double>(count);
  return fmt::format(
      "{} of its edges have a triangle on one side alone; the first hole has {} edges around ({:.6g}, {:.6g}, {:.6g})",
      rims, count, middle.x(), middle.y(), middle.z());
}

}  // namespace

SurfaceSolid solid_inside(const TriangleSurface& surface, const std::string& name) {
  if (!surface.closed())
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: the surface is open: {}. A body needs a closed one", name, hole_of(surface)));
  SurfaceSolid solid;
  Vec3 low = surface.points().front(), high = low;
  for (const Vec3& p : surface.points()) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  solid.extents = high - low;
  const Vec3 origin = 0.5 * (low + high);
  // Of a tetrahedron (0, a, b, c) of volume v: integral of x is v (a + b + c) / 4, that of x x^T is
  // v / 20 ((a + b + c) (a + b + c)^T + a a^T + b b^T + c c^T).
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (const auto& t : surface.triangles()) {
    Mat3 corners;
    for (int k = 0; k < 3; ++k)
      corners.col(k) = surface.points()[static_cast<std::size_t>(t[static_cast<std::size_t>(k)])] - origin;
    const double volume = corners.col(0).dot(corners.col(1).cross(corners.col(2))) / 6;
    const Vec3 sum = corners.rowwise().sum();
    solid.volume += volume;
    first += 0.25 * volume * sum;
    second += volume / 20 * (sum * sum.transpose() + corners * corners.transpose());
  }
  const Vec3 centre = first / solid.volume;
  second -= solid.volume * centre * centre.transpose();
  solid.centre = origin + centre;
  solid.inertia = second.trace() * Mat3::Identity() - second;
  return solid;
}

}  // namespace espalier::dynamics::contact
