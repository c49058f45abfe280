/// \file
/// A rigid surface of triangles: who neighbours whom, and what of it lies next to a point.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/at.hpp"
#include "dynamics/contact/geometry/box_tree.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics::contact {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

/// Triangles with their vertices anticlockwise seen from outside. Vertices that coincide are one (STL repeats them).
class TriangleSurface {
 public:
  /// @throws std::invalid_argument where nothing is left of it, a corner does not exist or is no number, or the
  /// triangles of a closed surface look inwards
  TriangleSurface(std::vector<Vec3> points, const std::vector<std::array<Index, 3>>& triangles);

  struct Edge {
    Index a = 0, b = 0;           ///< vertices
    Index left = -1, right = -1;  ///< triangles; right -1: the rim of an open surface
    bool ridge = false;           ///< convex (or a rim): what can be touched by another edge
  };
  [[nodiscard]] const std::vector<Vec3>& points() const { return points_; }
  [[nodiscard]] const std::vector<std::array<Index, 3>>& triangles() const { return triangles_; }
  [[nodiscard]] const std::vector<Edge>& edges() const { return edges_; }
  [[nodiscard]] const Vec3& normal(Index triangle) const { return normals_[at(triangle)]; }
  [[nodiscard]] const BoxTree& tree() const { return tree_; }            ///< of triangles
  [[nodiscard]] const BoxTree& edge_tree() const { return edge_tree_; }  ///< of ridges(), by their position there
  [[nodiscard]] const BoxTree& point_tree() const { return point_tree_; }
  [[nodiscard]] const std::vector<Index>& ridges() const { return ridges_; }  ///< edges
  [[nodiscard]] bool closed() const { return closed_; }
  /// How far below its faces a point still counts as having come through them: a quarter of the least extent.
  [[nodiscard]] double depth() const { return depth_; }

  /// What a point near the surface sees of it: faces that it projects into, ridges and corners that are nearer than the
  /// faces beside them.
  struct Near {
    enum class Kind { face, edge, vertex } kind = Kind::face;
    Index id = 0;         ///< of the triangle, edge or vertex
    Vec3 point;           ///< nearest
    double distance = 0;  ///< negative behind faces
  };
  /// All within `reach`. @param only_nearest  the one that is nearest alone
  void near(const Vec3& x, double reach, bool only_nearest, std::vector<Near>& out) const;

 private:
  /// What a triangle has nearest to a point.
  struct Hit {
    Near::Kind kind;
    Index id;
    Vec3 point;
    double distance;
  };
  void find_edges();
  void make_trees();
  void add_hit(const Vec3& x, Index triangle, double bound, std::vector<Hit>& hits) const;
  void add_near(const Vec3& x, std::vector<Hit>& hits, std::vector<Near>& out) const;

  std::vector<Vec3> points_, normals_;
  std::vector<std::array<Index, 3>> triangles_;
  std::vector<std::array<Index, 3>> sides_;  // edges of each triangle: 01, 12, 20
  std::vector<Edge> edges_;
  std::vector<Index> ridges_, fans_;  // fans: triangles at each vertex
  BoxTree tree_, edge_tree_, point_tree_;
  bool closed_ = false;
  double depth_ = 0, extent_ = 0;  // extent: the largest
};

/// Reads .stl (text or binary), .obj (v and f; polygons are cut into triangles), or the outer faces of a mesh file that
/// mesh/read.hpp knows. @param scale factor on all coordinates @throws Error(invalid_input)
[[nodiscard]] TriangleSurface read_surface(const std::string& path, double scale);

}  // namespace espalier::dynamics::contact
