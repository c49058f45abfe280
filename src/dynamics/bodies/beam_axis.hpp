/// \file
/// The unstressed shape of a beam: where its nodes are and how their sections stand.
#pragma once

#include <variant>
#include <vector>

#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

struct StraightAxis {
  Vec3 start, end;
};
/// Constant curvature: an arc, a twisted straight beam, or a helix.
struct ArcAxis {
  Vec3 start, direction;  ///< direction of the axis at the start, of any length
  double length = 0;
  Vec3 curvature = Vec3::Zero();  ///< turning per length in the axes of the section: twist, about y, about z (rad/m)
};
/// The smooth curve through points: a cubic spline by chord length with continuous curvature and "not-a-knot" ends
/// (de Boor 1978, chapter IV); three points give a parabola, two a line. Its error falls with the fourth power of the
/// distance of the points. The sections do not twist about it.
struct SplineAxis {
  std::vector<Vec3> points;
};
using AxisShape = std::variant<StraightAxis, ArcAxis, SplineAxis>;

/// Position and orthonormal axes of a node: x along the axis, y and z across it.
struct AxisNode {
  Vec3 position;
  Mat3 axes;  ///< columns x, y, z
};

/// Nodes at equal distances along the axis.
struct BeamAxis {
  std::vector<AxisNode> nodes;
  double element_length = 0;  ///< along the axis
};

/// @param y_direction the section's y axis at the start lies in the plane of the axis and this direction
/// @throws std::invalid_argument without a length, without elements, or when y_direction lies along the axis
[[nodiscard]] BeamAxis make_beam_axis(const AxisShape& shape, const Vec3& y_direction, Index elements);

}  // namespace espalier::dynamics
