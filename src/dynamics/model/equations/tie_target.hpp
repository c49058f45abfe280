/// \file
/// What nodes are tied to: points of the material of a solid's faces, of a shell, of a beam or a cable.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "dynamics/model/build/builders.hpp"

namespace espalier::dynamics::model {

/// A point of a body's material, by the body's vertices.
struct TiePoint {
  using Terms = std::vector<std::pair<Index, double>>;  ///< vertices and their factors
  /// A vector of the material there: the sum of factors times vertices, which is `value` at the start.
  struct Axis {
    Terms parts;
    Vec3 value = Vec3::Zero();
  };
  Terms place;                 ///< of solids and cables with a constant rest
  std::vector<Axis> axes;      ///< three, of cables none; the first are tangents, the last of shells the director, of
                               ///< solids one out of the element
  Vec3 normal = Vec3::Zero();  ///< of the face of a solid
  double distance = 0;         ///< from the body to the point that was asked for
  double reach = 0;            ///< up to which distance a node is taken as lying there, unless the text says
};

class TieTarget {
 public:
  virtual ~TieTarget() = default;
  /// @param own  node of the same body that asks, whose own elements do not count; -1: of another body
  [[nodiscard]] virtual TiePoint nearest(const Vec3& point, Index own) const = 0;
};

/// @param face  of a solid: a face set; else empty @throws std::invalid_argument
[[nodiscard]] std::unique_ptr<TieTarget> make_tie_target(const BuiltBody& body, const std::string& face,
                                                         const FrameBuilder& frames);

}  // namespace espalier::dynamics::model
