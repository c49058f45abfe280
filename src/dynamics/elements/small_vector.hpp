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

/// m[j][i]: row i, column j (by columns, as element tangents are).
struct M3 {
  double m[3][3] = {};

  /// += s a b^T
  ESPALIER_INLINE void add_outer(double s, const V3& a, const V3& b) {
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) m[j][i] += s * a.x[i] * b.x[j];
  }
  /// += s I
  ESPALIER_INLINE void add_identity(double s) {
    for (int i = 0; i < 3; ++i) m[i][i] += s;
  }
  /// += s [a]_x, [a]_x b = a x b
  ESPALIER_INLINE void add_cross(double s, const V3& a) {
    m[1][0] -= s * a.x[2];
    m[0][1] += s * a.x[2];
    m[2][0] += s * a.x[1];
    m[0][2] -= s * a.x[1];
    m[2][1] -= s * a.x[0];
    m[1][2] += s * a.x[0];
  }
  /// += s a
  ESPALIER_INLINE void add(double s, const M3& a) {
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) m[j][i] += s * a.m[j][i];
  }
  /// += a^T b
  ESPALIER_INLINE void add_transposed_product(const M3& a, const M3& b) {
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) m[j][i] += a.m[i][0] * b.m[j][0] + a.m[i][1] * b.m[j][1] + a.m[i][2] * b.m[j][2];
  }
};

}  // namespace espalier::dynamics
