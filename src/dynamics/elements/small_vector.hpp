/// \file
/// Vectors and matrices of three for elements whose formulas are written out. Plain structs, so that every clone of a
/// function (dispatch.hpp) gets code for its own machine.
#pragma once

#include "dynamics/elements/dispatch.hpp"

namespace espalier::dynamics {

struct V3 {
  double x[3] = {};
};

ESPALIER_INLINE V3 operator+(const V3& a, const V3& b) { return {{a.x[0] + b.x[0], a.x[1] + b.x[1], a.x[2] + b.x[2]}}; }
ESPALIER_INLINE V3 operator-(const V3& a, const V3& b) { return {{a.x[0] - b.x[0], a.x[1] - b.x[1], a.x[2] - b.x[2]}}; }
ESPALIER_INLINE V3 operator*(double s, const V3& a) { return {{s * a.x[0], s * a.x[1], s * a.x[2]}}; }
ESPALIER_INLINE double dot(const V3& a, const V3& b) { return a.x[0] * b.x[0] + a.x[1] * b.x[1] + a.x[2] * b.x[2]; }
ESPALIER_INLINE V3 cross(const V3& a, const V3& b) {
  return {{a.x[1] * b.x[2] - a.x[2] * b.x[1], a.x[2] * b.x[0] - a.x[0] * b.x[2], a.x[0] * b.x[1] - a.x[1] * b.x[0]}};
}

}  // namespace espalier::dynamics
