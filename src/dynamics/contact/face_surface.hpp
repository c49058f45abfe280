/// \file
/// Faces of a solid body as a surface that touches.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/contact/box_tree.hpp"

namespace espalier::dynamics::contact {

using Vec3 = Eigen::Vector3d;

inline constexpr int kMostFaceNodes = 8;

/// A face with its current shape.
struct SurfaceFace {
  ElementType type = ElementType::tri3;
  std::vector<Index> places;    ///< of each node: where its position begins in the configuration
  std::vector<Index> rows;      ///< of each node: its first velocity coordinate
  std::vector<Index> names;     ///< of each node: its number in the body
  std::vector<Vec3> reference;  ///< positions without stress
  std::vector<Vec3> x, v;       ///< at the state of the last move_to()
  double size = 0;              ///< root of its area, without stress
  Index element = 0;            ///< that it belongs to
  [[nodiscard]] int count() const { return static_cast<int>(places.size()); }
  /// Velocity coordinates of all nodes, three each.
  [[nodiscard]] std::vector<Index> all_rows() const;
};

/// Position, tangents and second derivatives of a face at a place (xi_1, xi_2) on it.
struct FacePlace {
  std::array<double, kMostFaceNodes> value{};
  std::array<std::array<double, kMostFaceNodes>, 2> slope{};
  Vec3 x = Vec3::Zero();
  std::array<Vec3, 2> tangent = {Vec3::Zero(), Vec3::Zero()};
  [[nodiscard]] Vec3 normal_area() const { return tangent[0].cross(tangent[1]); }
};
[[nodiscard]] FacePlace face_place(ElementType type, const std::vector<Vec3>& nodes, const double* xi);
/// x,11, x,12 and x,22.
[[nodiscard]] std::array<Vec3, 3> face_bends(ElementType type, const std::vector<Vec3>& nodes, const double* xi);

/// The point of a face, or of its continuation, on whose normal x lies.
struct FaceProjection {
  std::array<double, 2> xi{};
  double outside = 1e300;  ///< how far beyond the sides of the face, in xi; 0 on it, 1e300: there is none
};
[[nodiscard]] FaceProjection project_on_face(const SurfaceFace& face, const Vec3& x);

class FaceSurface {
 public:
  /// @param body in a system already @param faces empty: all outer faces of the mesh
  /// @throws std::invalid_argument unless the body is a solid, or where there is no face
  FaceSurface(std::string name, const FlexibleBody& body, const Mesh& mesh, std::span<const MeshFace> faces);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const FlexibleBody& body() const { return *body_; }
  [[nodiscard]] const std::vector<SurfaceFace>& faces() const { return faces_; }
  [[nodiscard]] const SurfaceFace& face(Index f) const { return faces_[static_cast<std::size_t>(f)]; }
  void move_to(ConstSpan q, ConstSpan v);
  [[nodiscard]] const std::vector<Box>& boxes() const { return boxes_; }
  /// Of the boxes of the last move_to(), refitted when it is asked for.
  [[nodiscard]] const BoxTree& tree();
  [[nodiscard]] double mean_size() const { return mean_size_; }
  /// Nodes that the faces have, each once, rising.
  [[nodiscard]] const std::vector<Index>& nodes() const { return nodes_; }

 private:
  std::string name_;
  const FlexibleBody* body_;
  std::vector<SurfaceFace> faces_;
  std::vector<Index> nodes_;
  std::vector<Box> boxes_;
  BoxTree tree_;
  bool tree_stale_ = true;
  double mean_size_ = 0;
};

}  // namespace espalier::dynamics::contact
