#include "dynamics/contact/geometry/surface_inertia.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <numbers>
#include <vector>

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

const Vec3& corner_of(const TriangleSurface& surface, Index triangle, std::size_t k) {
  return surface.points()[static_cast<std::size_t>(surface.triangles()[static_cast<std::size_t>(triangle)][k])];
}

/// Triangles that hang together by edges.
struct Shell {
  std::vector<Index> triangles;
  Vec3 low, high;
  double volume = 0;
};
std::vector<Shell> shells_of(const TriangleSurface& surface) {
  const std::size_t count = surface.triangles().size();
  std::vector<std::vector<Index>> beside(count);
  for (const auto& edge : surface.edges()) {
    beside[static_cast<std::size_t>(edge.left)].push_back(edge.right);
    beside[static_cast<std::size_t>(edge.right)].push_back(edge.left);
  }
  std::vector<Shell> shells;
  std::vector<bool> seen(count);
  for (std::size_t first = 0; first < count; ++first) {
    if (seen[first]) continue;
    seen[first] = true;
    const Vec3 origin = corner_of(surface, static_cast<Index>(first), 0);
    Shell shell{{static_cast<Index>(first)}, origin, origin};
    for (std::size_t k = 0; k < shell.triangles.size(); ++k) {
      const Index t = shell.triangles[k];
      Mat3 corners;
      for (std::size_t i = 0; i < 3; ++i) {
        shell.low = shell.low.cwiseMin(corner_of(surface, t, i));
        shell.high = shell.high.cwiseMax(corner_of(surface, t, i));
        corners.col(static_cast<Eigen::Index>(i)) = corner_of(surface, t, i) - origin;
      }
      shell.volume += corners.col(0).dot(corners.col(1).cross(corners.col(2))) / 6;
      for (const Index next : beside[static_cast<std::size_t>(t)])
        if (!seen[static_cast<std::size_t>(next)]) {
          seen[static_cast<std::size_t>(next)] = true;
          shell.triangles.push_back(next);
        }
    }
    shells.push_back(std::move(shell));
  }
  return shells;
}

/// How many times a shell winds around x: 1 inside. Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983).
double winding(const TriangleSurface& surface, const Shell& shell, const Vec3& x) {
  if ((x - shell.low).minCoeff() < 0 || (shell.high - x).minCoeff() < 0) return 0;
  double angle = 0;
  for (const Index t : shell.triangles) {
    const Vec3 a = corner_of(surface, t, 0) - x, b = corner_of(surface, t, 1) - x, c = corner_of(surface, t, 2) - x;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    angle += 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return angle / (4 * std::numbers::pi);
}

/// Where there are several shells, each is a piece of its own, or the wall of a cavity inside of one.
void check_shells(const TriangleSurface& surface, const std::string& name) {
  const std::vector<Shell> shells = shells_of(surface);
  for (const Shell& shell : shells) {
    const Vec3 x = corner_of(surface, shell.triangles.front(), 0);
    double inside = 0;
    for (const Shell& other : shells)
      if (&other != &shell) inside += winding(surface, other, x);
    constexpr double kTouches = 0.25;  // on the surface of another one it is a half
    const char* wrong = nullptr;
    if (shell.volume < 0 && inside < kTouches)
      wrong = "has normals that look inwards, and lies in no other piece; reverse the order of its triangles' corners";
    if (shell.volume > 0 && inside > 1 - kTouches)
      wrong = "lies inside of another one and would count twice; a cavity has normals that look into it";
    if (wrong != nullptr)
      throw Error(StatusCode::invalid_input, fmt::format("{}: the piece of the surface at ({:.6g}, {:.6g}, {:.6g}) {}",
                                                         name, x.x(), x.y(), x.z(), wrong));
  }
}

}  // namespace

SurfaceSolid solid_inside(const TriangleSurface& surface, const std::string& name) {
  if (!surface.closed())
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: the surface is open: {}. A body needs a closed one", name, hole_of(surface)));
  check_shells(surface, name);
  SurfaceSolid solid;
  Vec3 low = surface.points().front(), high = low;
  for (const Vec3& p : surface.points()) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  solid.extents = high - low;
  const Vec3 origin = 0.5 * (low + high);
  // Moments of a tetrahedron (0, a, b, c) of volume v: integral of x is v (a + b + c) / 4, that of x x^T is
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
