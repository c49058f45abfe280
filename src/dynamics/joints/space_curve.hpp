/// \file
/// A curve through points in space, and the coordinates of a point beside it.
#pragma once

#include <memory>

#include "dynamics/joints/joint.hpp"
#include "dynamics/joints/space_spline.hpp"

namespace espalier::dynamics {

/// The spline c(u) through points, closed or open; u is the length of the chords between the points. Beyond its ends an
/// open curve goes on straight. Along it goes a normal field m(u) that turns about the tangent as little as it can.
class SpaceCurve {
 public:
  /// @throws std::invalid_argument naming the points: fewer than two (closed: three), two that follow each other and
  /// are one, a cusp between two of them, numbers that are not finite
  SpaceCurve(std::vector<Vec3> points, bool closed);

  [[nodiscard]] bool closed() const { return path_.closed(); }
  [[nodiscard]] SplinePoint at(double u) const { return path_.at(u); }
  [[nodiscard]] SplinePoint normal(double u) const;
  /// Arc length from the first point; of a closed curve it goes on round by round.
  [[nodiscard]] double arc(double u) const;
  [[nodiscard]] double length() const { return arcs_.back(); }
  [[nodiscard]] double least() const { return path_.least(); }
  [[nodiscard]] double most() const { return path_.most(); }
  /// The parameter of the nearest place downhill from `guess`.
  [[nodiscard]] double foot(const Vec3& p, double guess) const;
  /// The nearest of all.
  [[nodiscard]] double nearest(const Vec3& p) const;

 private:
  void check_cusps() const;
  void make_normals();
  [[nodiscard]] double arc_between(double from, double to) const;

  SpaceSpline path_, normals_;
  std::vector<double> arcs_;  // at the knots
};
using SpaceCurvePtr = std::shared_ptr<const SpaceCurve>;

/// Where on a curve a point is. The place of the last accepted state tells branches of a curve that comes near itself
/// apart, and rounds of a closed one.
class CurveFollower final : public PairMemory {
 public:
  explicit CurveFollower(SpaceCurvePtr curve) : curve_(std::move(curve)) {}
  [[nodiscard]] const SpaceCurve& curve() const { return *curve_; }
  [[nodiscard]] double foot(const Vec3& p) const { return known_ ? curve_->foot(p, u_) : curve_->nearest(p); }
  void accept(const FrameMotion& a, const FrameMotion& b) override;
  void save(std::vector<double>& out) const override;
  void restore(ConstSpan& in) override;

 private:
  SpaceCurvePtr curve_;
  bool known_ = false;
  double u_ = 0;
};
using CurveFollowerPtr = std::shared_ptr<const CurveFollower>;

/// (p - c) . m, or (p - c) . (m x c') with `second`, c and m at the foot of p: zero on the curve.
[[nodiscard]] PairFunctionPtr beside_curve(CurveFollowerPtr follower, bool second);
/// The arc length of the foot.
[[nodiscard]] PairFunctionPtr along_curve(CurveFollowerPtr follower);

/// The origin of B stays on a curve in frame A. @param motion  leads it along the curve: its arc length
[[nodiscard]] std::unique_ptr<Joint> point_on_curve(std::string name, FramePtr a, FramePtr b, SpaceCurvePtr curve,
                                                    std::optional<TimeFunction> motion = std::nullopt);

}  // namespace espalier::dynamics
