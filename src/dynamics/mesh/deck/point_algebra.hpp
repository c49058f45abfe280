/// \file
/// Vectors of points of a deck.
#pragma once

#include <cmath>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

inline Point difference_of(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline double dot_product(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Point cross_product(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline Point scaled_by(double factor, const Point& a) { return {factor * a[0], factor * a[1], factor * a[2]}; }
/// The direction, of length one; zeros where the vector has no direction.
inline Point direction_of(const Point& a) {
  const double length = std::hypot(a[0], a[1], a[2]);
  return length > 0 ? scaled_by(1 / length, a) : Point{};
}

}  // namespace espalier::dynamics
