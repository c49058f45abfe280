/// \file
/// The profile of an involute spur gear as its basic rack generates it (ISO 53, profile A).
#pragma once

#include <array>

#include "dynamics/meshers/parts.hpp"

namespace espalier::dynamics {

/// Addendum, dedendum and radius of the fillet of the basic rack, in modules (ISO 53, profile A). The radius is smaller
/// where the pressure angle leaves no room for it.
inline constexpr double kRackAddendum = 1.0, kRackDedendum = 1.25, kRackFillet = 0.38;

/// Half a tooth of a gear whose tooth stands on the x axis: from the middle of the gap along the root, the fillet and
/// the involute to the tip. Points are those where the rack touches the tooth: the common normal goes through the pitch
/// point (Litvin and Fuentes, Gear Geometry and Applied Theory (2004), 5 and 6). The other half is the mirror image.
class ToothProfile {
 public:
  /// @throws std::invalid_argument where the numbers make no tooth: undercut, pointed, a bore that is too large
  explicit ToothProfile(const GearShape& shape);

  using Place = std::array<double, 2>;  ///< radius and angle from the middle of the tooth, m and radians, angle >= 0

  /// The involute from its end at the fillet (u = 0) to the tip (u = 1). Equal steps have chords that are equally
  /// far from it, so they are shorter at the fillet, where it is curved most.
  [[nodiscard]] Place involute(double u) const;
  /// The fillet from its end at the root circle (u = 0) to the involute (u = 1).
  [[nodiscard]] Place fillet(double u) const;

  [[nodiscard]] double pitch_radius() const { return pitch_; }
  [[nodiscard]] double base_radius() const { return base_; }
  [[nodiscard]] double tip_radius() const { return tip_; }
  [[nodiscard]] double root_radius() const { return root_; }
  /// Half of the angle between two teeth.
  [[nodiscard]] double half_pitch() const { return half_pitch_; }
  [[nodiscard]] double involute_length() const;

 private:
  /// The rack touches at (px, py) from the pitch point when it has moved by `shift` along its pitch line.
  [[nodiscard]] Place turned_back(double px, double py, double shift) const;

  double pressure_angle_, pitch_, base_, tip_, root_, half_pitch_;
  double thinner_;                // angle by which each flank stands back for the backlash
  double straight_;               // depth of the straight part of the rack below the pitch line
  double corner_x_, corner_y_;    // middle of the rounding of the rack's tip
  double rounding_;               // its radius
  double roll_begin_, roll_end_;  // of the involute: distance from the base circle along its tangent, over base_
  double flank_x_;                // of the rack's flank on the pitch line
  double relief_, relief_begin_;  // at the tip; where it begins, as roll_begin_
};

}  // namespace espalier::dynamics
