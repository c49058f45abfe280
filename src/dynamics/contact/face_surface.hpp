/// \file
/// Faces of solids, both sides of shells, and the axes of cables and beams, as surfaces that touch.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/contact/geometry/box_tree.hpp"

namespace espalier::dynamics::contact {

using Vec3 = Eigen::Vector3d;

inline constexpr int kMostFaceNodes = 8;

/// Three velocity coordinates of a node of a face, and three of the director that carries it: x = r + lift d.
struct NodeRows {
  Index position = 0;
  Index director = -1;  ///< shells alone
  double lift = 0;      ///< half the thickness, with the sign of the side
  [[nodiscard]] bool operator==(const NodeRows&) const = default;
};

/// A face with its current shape. Its nodes are those of a solid, points on one side of a shell, or (type line2) the
/// positions and slopes r1, r1', r2, r2' of an element of a cable or beam, between which the axis is a cubic.
struct SurfaceFace {
  ElementType type = ElementType::tri3;
  std::vector<NodeRows> rows;
  std::vector<Index> places;           ///< of each node: where its position begins in the configuration
  std::vector<Index> director_places;  ///< of shells: where its director begins there
  std::vector<Index> names;            ///< of each node: see FaceSurface::nodes(); -1: it is a slope
  std::vector<Vec3> reference;         ///< positions without stress
  std::vector<Vec3> x, v;              ///< at the state of the last move_to()
  double size = 0;                     ///< without stress: root of its area, length of a line
  double radius = 0;                   ///< of the layer around a line
  double depth = 0;                    ///< so far below it something has come through it
  Index element = 0;                   ///< that it belongs to
  [[nodiscard]] int count() const { return static_cast<int>(places.size()); }
  [[nodiscard]] bool is_line() const { return type == ElementType::line2; }
  [[nodiscard]] bool is_triangle() const { return type == ElementType::tri3 || type == ElementType::tri6; }
  /// All velocity coordinates that it depends on.
  [[nodiscard]] std::vector<Index> all_rows() const;
};

/// Neighbours of one body: whether they share a node or are faces of one element.
[[nodiscard]] bool are_neighbours(const SurfaceFace& a, const SurfaceFace& b);

/// Position, tangents and second derivatives of a face at a place (xi_1, xi_2) on it; of a line by xi_1 alone.
struct FacePlace {
  std::array<double, kMostFaceNodes> value{};
  std::array<std::array<double, kMostFaceNodes>, 2> slope{};
  Vec3 x = Vec3::Zero();
  std::array<Vec3, 2> tangent = {Vec3::Zero(), Vec3::Zero()};
  [[nodiscard]] Vec3 normal_area() const { return tangent[0].cross(tangent[1]); }
};
/// @param nodes  face.x, face.reference or velocities
[[nodiscard]] FacePlace face_place(const SurfaceFace& face, const std::vector<Vec3>& nodes, const double* xi);
[[nodiscard]] inline FacePlace face_place(const SurfaceFace& face, const double* xi) {
  return face_place(face, face.x, xi);
}
/// x,11, x,12 and x,22. @param nodes  face.x, or velocities
[[nodiscard]] std::array<Vec3, 3> face_bends(const SurfaceFace& face, const std::vector<Vec3>& nodes, const double* xi);
[[nodiscard]] inline std::array<Vec3, 3> face_bends(const SurfaceFace& face, const double* xi) {
  return face_bends(face, face.x, xi);
}
/// The point of a face, or of its continuation, on whose normal x lies. Of a line: the nearest one.
struct FaceProjection {
  std::array<double, 2> xi{};
  double outside = 1e300;  ///< how far beyond the sides of the face, in xi; 0 on it, 1e300: there is none
};
/// @param near  a place to begin with, say where it was before; null: the middle
[[nodiscard]] FaceProjection project_on_face(const SurfaceFace& face, const Vec3& x,
                                             const std::array<double, 2>* near = nullptr);
/// False where x is certainly not over a face, or its continuation by a tenth of it, at a height in [-below, above].
/// Cheap beside the projection. Lines: always true.
[[nodiscard]] bool may_be_over(const SurfaceFace& face, const Vec3& x, double below, double above);

/// Which sides of a shell touch; the directors point to `top`.
enum class ShellSides { both, top, bottom };

class FaceSurface {
 public:
  /// The surface of a solid. @param body in a system already @param faces empty: all outer faces of the mesh
  /// @throws std::invalid_argument unless the body is a solid, or where there is no face
  FaceSurface(std::string name, const FlexibleBody& body, const Mesh& mesh, std::span<const MeshFace> faces);
  /// The surface of a shell. @param quads as make_shell_body()'s
  FaceSurface(std::string name, const FlexibleBody& body, std::span<const std::array<Index, 4>> quads, double thickness,
              ShellSides sides);
  /// The surface of a cable or beam: what lies within `radius` of its axis. @param element_length without stress @param
  /// divisions parts of each element that have points of integration of their own
  /// @throws std::invalid_argument unless the body is one, and radius and divisions are positive
  FaceSurface(std::string name, const FlexibleBody& body, double element_length, double radius, int divisions);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const FlexibleBody& body() const { return *body_; }
  [[nodiscard]] const std::vector<SurfaceFace>& faces() const { return faces_; }
  [[nodiscard]] const SurfaceFace& face(Index f) const { return faces_[at(f)]; }
  void move_to(ConstSpan q, ConstSpan v);
  [[nodiscard]] const std::vector<Box>& boxes() const { return boxes_; }
  /// The tree of the boxes of the last move_to(), refitted when it is asked for.
  [[nodiscard]] const BoxTree& tree();
  /// Makes the depths of the faces at most half the distance to those faces of `other`, on the same body, that lie
  /// behind them without stress: what is thin is not gone through.
  void limit_depths(const FaceSurface& other);
  [[nodiscard]] double mean_size() const { return mean_size_; }
  [[nodiscard]] bool is_line() const { return faces_.front().is_line(); }
  [[nodiscard]] int divisions() const { return divisions_; }
  /// The divisions of faces: parts in each direction that have points of integration of their own against rigid shapes.
  void set_divisions(int divisions) { divisions_ = divisions; }
  /// Nodes that the faces have, each once, rising: their numbers in the body, and those on the bottom of a shell behind
  /// all of them; see body_node().
  [[nodiscard]] const std::vector<Index>& nodes() const { return nodes_; }
  [[nodiscard]] Index body_node(Index node) const { return node % body_->nodes(); }

 private:
  void add_face(SurfaceFace face);
  void finish();

  std::string name_;
  const FlexibleBody* body_;
  std::vector<SurfaceFace> faces_;
  std::vector<Index> nodes_;
  std::vector<Box> boxes_;
  BoxTree tree_;
  bool tree_stale_ = true;
  double mean_size_ = 0;
  int divisions_ = 1;
};

}  // namespace espalier::dynamics::contact
