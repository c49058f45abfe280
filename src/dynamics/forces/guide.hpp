/// \file
/// A point that slides along a guide: contact with a path of straight segments and arcs, by penalty.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamics/forces/frame_force.hpp"

namespace espalier::dynamics {

/// A smooth path in a plane: straight segments and arcs, each beginning where and in the direction in which its
/// predecessor ends. Before its first and behind its last segment it goes on straight.
class GuidePath {
 public:
  /// @param start its first point (z is not used) @param direction of its first tangent, radians from x towards y
  explicit GuidePath(Vec3 start = Vec3::Zero(), double direction = 0);
  /// @param curvature 1/radius, positive: to the left; 0: straight
  void add(double length, double curvature);

  /// Nearest point: signed distance (positive to the left of the path), tangent, normal to the left, curvature there.
  struct Nearest {
    double distance = 0;
    double curvature = 0;
    Vec3 tangent = Vec3::UnitX(), normal = Vec3::UnitY();
  };
  [[nodiscard]] Nearest nearest(const Vec3& point) const;
  [[nodiscard]] Vec3 point(double arc_length) const;
  [[nodiscard]] double length() const;

 private:
  struct Segment {
    Vec3 start;
    double direction, length, curvature;
    [[nodiscard]] double turn(double s) const { return direction + curvature * s; }
    [[nodiscard]] Vec3 at(double s) const;
  };
  std::vector<Segment> segments_;
  Vec3 end_;
  double end_direction_;
};

/// Force of the guide on the point. With the penetration p (how far the point is to the right of the path):
/// elastic normal force N(p) = 0 for p <= 0, k p^2 / (2 e) for p < e, k (p - e/2) beyond, e = `smoothing`, so that the
/// tangent stays continuous; with both_sides N = k p for all p. Damping c N'(p)/k on the rate of p, friction
/// -mu |N| tanh(slip / slip_speed).
struct GuideLaw {
  GuidePath path;         ///< in the x-y plane of frame A
  double stiffness = 0;   ///< k, force per length
  double damping = 0;     ///< c, force times time per length
  double friction = 0;    ///< mu
  double slip_speed = 1;  ///< speed at which friction is developed (tanh 1 = 76 %)
  double smoothing = 1;   ///< e, length
  bool both_sides = false;
};

/// The origin of frame B slides along the path in frame A; motion along z_A is free.
/// @throws std::invalid_argument where stiffness, smoothing or slip_speed is not positive
[[nodiscard]] std::unique_ptr<FrameForce> guide(std::string name, FramePtr a, FramePtr b, GuideLaw law);

}  // namespace espalier::dynamics
