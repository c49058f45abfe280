/// \file
/// Cubic splines through points in space.
#pragma once

#include <vector>

#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics {

/// A value with its first three derivatives.
struct SplinePoint {
  Vec3 x = Vec3::Zero(), d1 = Vec3::Zero(), d2 = Vec3::Zero(), d3 = Vec3::Zero();
};

/// Second derivatives at the knots of the cubic spline through values y_i at increasing x_i: not-a-knot at the ends (a
/// parabola of three points, a line of two). @param period  > 0: y repeats after x_0 + period, twice differentiable
[[nodiscard]] std::vector<Vec3> spline_bends(const std::vector<double>& x, const std::vector<Vec3>& y, double period);

/// A twice differentiable function of u by pieces of third degree; closed, or with straight tangents beyond its ends.
class SpaceSpline {
 public:
  SpaceSpline() = default;
  /// @param knots rising, one for each value; a closed one has one more, where the first value comes again
  SpaceSpline(std::vector<double> knots, std::vector<Vec3> values, bool closed);

  [[nodiscard]] SplinePoint at(double u) const;
  [[nodiscard]] bool closed() const { return closed_; }
  [[nodiscard]] const std::vector<double>& knots() const { return knots_; }
  [[nodiscard]] double least() const { return knots_.front(); }
  [[nodiscard]] double most() const { return knots_.back(); }
  /// The parameter of a closed one, taken into its first round.
  [[nodiscard]] double wrapped(double u) const;

 private:
  bool closed_ = false;
  std::vector<double> knots_;
  std::vector<Vec3> values_, bends_;  // at each knot
};

}  // namespace espalier::dynamics
