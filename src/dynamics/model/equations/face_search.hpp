/// \file
/// The nearest points on faces of a mesh.
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "dynamics/bodies/rotation.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics::model {

struct FacePoint {
  std::vector<std::pair<Index, double>> weights;  ///< nodes of the face and their shares in the point
  double distance = 0, extent = 0;                ///< to the point that was asked for; of the face
};

class FaceSearch {
 public:
  /// @param place  of a node @param mesh, faces, place  outlive this
  FaceSearch(const Mesh& mesh, const std::vector<MeshFace>& faces, const std::function<Vec3(Index)>& place);
  [[nodiscard]] FacePoint nearest(const Vec3& point) const;

 private:
  struct Face {
    ElementType type;
    std::vector<Index> nodes;
    std::vector<Vec3> places;
    Vec3 centre;
    double radius;
  };
  static std::pair<std::vector<double>, double> project(const Face& face, const Vec3& point);
  std::vector<Face> faces_;
};

}  // namespace espalier::dynamics::model
