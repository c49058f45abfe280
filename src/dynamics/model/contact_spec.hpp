/// \file
/// Surfaces of a model and their contacts, as plain data.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "dynamics/contact/geometry/shape.hpp"
#include "dynamics/contact/geometry/sprocket.hpp"
#include "dynamics/contact/law.hpp"
#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {

/// A triangle mesh from a file; see contact/triangles.hpp.
struct SurfaceFile {
  std::string path;
  Vec3 scale = Vec3::Ones();  ///< factors on the coordinates
};
/// Faces of a solid body, or sides of a shell.
struct SolidFaces {
  std::string set;    ///< of faces; empty: all outer faces. Of a shell: "top", "bottom", or both where empty
  int divisions = 1;  ///< of each face in each direction, for integration against rigid shapes
};
/// The axis of a cable or beam with what is around it.
struct LineSurface {
  double radius = 0;
  int divisions = 1;  ///< of each element, for integration
};

/// What may touch other surfaces: a shape on a rigid body or the ground, faces of a solid or shell, or a line.
struct SurfaceSpec {
  Place place;
  std::string name, body;
  std::variant<contact::Shape, SurfaceFile, SolidFaces, contact::SprocketShape, LineSurface> shape;
  Vec3 point = Vec3::Zero();     ///< of the shape's origin, from the centre of mass, in body axes (ground: global)
  Mat3 axes = Mat3::Identity();  ///< columns: axes of the shape in body axes
};

struct ContactSpec {
  Place place;
  std::string name;
  bool active = true;                 ///< at the start
  std::vector<std::string> surfaces;  ///< names, with * for any letters
  std::vector<std::string> against;   ///< empty: each of `surfaces` may touch each other one
  bool self = false;                  ///< faces among `surfaces` touch themselves, too
  contact::ContactLaw law;
  double margin = 0;              ///< of the search for near pairs; 0: chosen
  std::optional<double> overlap;  ///< allowed at the start
  double penetration = 0;         ///< of solids: augmented Lagrangian to at most so much; 0: penalty alone
};

}  // namespace espalier::dynamics::model
