/// \file
/// The nearest points on faces of a mesh.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics::model {

struct FacePoint {
  std::vector<std::pair<Index, double>> weights;  ///< nodes of the face and their shares in the point
  double distance = 0, extent = 0;                ///< to the point that was asked for; of the face
  std::array<std::vector<double>, 2> slopes{};    ///< of the same nodes in the tangents, along the face's coordinates
  std::array<Vec3, 2> tangents{Vec3::Zero(), Vec3::Zero()};
  std::vector<Index> behind{};  ///< corners of the element that are not of the face; none of shells
  [[nodiscard]] Vec3 normal() const { return tangents[0].cross(tangents[1]).normalized(); }
};

class NearestFace {
 public:
  /// @param place  of a node @param mesh, faces, place  outlive this
  NearestFace(const Mesh& mesh, const std::vector<MeshFace>& faces, const std::function<Vec3(Index)>& place);
  /// The same with quadrilaterals of a shell.
  NearestFace(std::span<const std::array<Index, 4>> quads, const std::function<Vec3(Index)>& place);
  /// @param without  faces with this node do not count; -1: all do
  [[nodiscard]] FacePoint nearest(const Vec3& point, Index without = -1) const;

 private:
  struct Face {
    ElementType type;
    std::vector<Index> nodes;
    std::vector<Vec3> places;
    Vec3 centre;
    double radius;
    std::vector<Index> behind{};
  };
  void add(ElementType type, std::vector<Index> nodes, const std::function<Vec3(Index)>& place);
  static FacePoint project(const Face& face, const Vec3& point);
  std::vector<Face> faces_;
};

}  // namespace espalier::dynamics::model
