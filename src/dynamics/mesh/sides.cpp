#include "dynamics/mesh/sides.hpp"

#include <algorithm>
#include <limits>

namespace espalier::dynamics {
namespace {

/// Whether some face set is less than all faces of the surface.
bool names_a_part(const Mesh& mesh, std::size_t surface) {
  return std::any_of(mesh.face_sets.begin(), mesh.face_sets.end(),
                     [&](const auto& set) { return !set.second.empty() && set.second.size() < surface; });
}

/// How far the farthest node of each face lies from the end of the mesh.
std::vector<double> distances(const Mesh& mesh, std::span<const MeshFace> faces, std::size_t axis, bool upper) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::vector<double> from, to;
  double low = kInfinity, high = -kInfinity;
  for (const MeshFace& face : faces) {
    double least = kInfinity, most = -kInfinity;
    for (const Index n : mesh.face_nodes(face)) {
      least = std::min(least, mesh.nodes[at(n)][axis]);
      most = std::max(most, mesh.nodes[at(n)][axis]);
    }
    from.push_back(least);
    to.push_back(most);
    low = std::min(low, least);
    high = std::max(high, most);
  }
  for (std::size_t k = 0; k < from.size(); ++k) from[k] = upper ? high - from[k] : to[k] - low;
  return from;
}

}  // namespace

bool add_side_sets(Mesh& mesh) {
  if (!mesh.face_sets.empty()) {
    const auto [least, most] =
        std::minmax_element(mesh.face_sets.begin(), mesh.face_sets.end(),
                            [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
    if (least->second.size() < most->second.size()) return false;
  }
  const std::vector<MeshFace> outer = mesh.boundary_faces();
  if (outer.empty() || names_a_part(mesh, outer.size())) return false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double extent = 0;
    for (const double d : distances(mesh, outer, axis, false)) extent = std::max(extent, d);
    for (const bool upper : {false, true}) {
      const std::vector<double> d = distances(mesh, outer, axis, upper);
      const double nearest = *std::min_element(d.begin(), d.end());
      constexpr double kFlat = 1e-3, kRound = 0.1;
      const double reach = nearest <= kFlat * extent ? kFlat * extent : std::max(nearest, kRound * extent);
      std::vector<MeshFace> faces;
      for (std::size_t k = 0; k < outer.size(); ++k)
        if (d[k] <= reach) faces.push_back(outer[k]);
      mesh.face_sets.emplace(std::string(1, static_cast<char>('x' + axis)) + (upper ? "1" : "0"), std::move(faces));
    }
  }
  return true;
}

}  // namespace espalier::dynamics
