#include "dynamics/meshers/involute.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace espalier::dynamics {

ToothProfile::ToothProfile(const GearShape& s) : pressure_angle_(s.pressure_angle) {
  constexpr double pi = std::numbers::pi, kDegree = pi / 180;
  if (s.teeth < 6 || !(s.module > 0) || !(s.width > 0) || !(s.bore_radius > 0) || !(s.backlash >= 0) ||
      !(s.tip_relief >= 0))
    throw std::invalid_argument(
        "spur gear: need at least 6 teeth, module, width and bore above 0 and no negative backlash or tip relief");
  if (!(s.pressure_angle >= 14 * kDegree && s.pressure_angle <= 30 * kDegree))
    throw std::invalid_argument(
        fmt::format("spur gear: the pressure angle must lie between 14 and 30 degrees (0.2443 and 0.5236 radians), not "
                    "{:g} radians",
                    s.pressure_angle));
  const double m = s.module, sine = std::sin(pressure_angle_), tangent = std::tan(pressure_angle_);
  pitch_ = 0.5 * m * s.teeth;
  base_ = pitch_ * std::cos(pressure_angle_);
  tip_ = pitch_ + kRackAddendum * m;
  root_ = pitch_ - kRackDedendum * m;
  half_pitch_ = pi / s.teeth;
  thinner_ = 0.25 * s.backlash / pitch_;
  // At most the rounding that fills the whole tip of the rack.
  const double land = 0.25 * pi - kRackDedendum * tangent;
  rounding_ = m * std::min(kRackFillet, land / std::tan(0.25 * pi - 0.5 * pressure_angle_));
  straight_ = kRackDedendum * m - rounding_ * (1 - sine);
  flank_x_ = 0.25 * pi * m;
  corner_x_ = flank_x_ + straight_ * tangent + rounding_ * std::cos(pressure_angle_);
  corner_y_ = rounding_ - kRackDedendum * m;
  roll_begin_ = (pitch_ * sine - straight_ / sine) / base_;
  roll_end_ = std::sqrt(tip_ * tip_ - base_ * base_) / base_;
  const double relieved = pitch_ + 0.5 * kRackAddendum * m;
  relief_ = s.tip_relief;
  relief_begin_ = std::sqrt(relieved * relieved - base_ * base_) / base_;
  if (roll_begin_ < 0)
    throw std::invalid_argument(
        fmt::format("spur gear: {} teeth are undercut at this pressure angle; take {} or more, or a larger angle",
                    s.teeth, static_cast<int>(std::ceil(2 * straight_ / (m * sine * sine)))));
  if (!(s.bore_radius < root_ - 0.8 * m))
    throw std::invalid_argument(
        fmt::format("spur gear: the bore's radius must stay below {:g}, 0.8 modules inside the root", root_ - 0.8 * m));
  if (const double half = involute(1)[1] * tip_; !(half > 0.05 * m))
    throw std::invalid_argument(
        fmt::format("spur gear: the teeth are pointed ({:.3g} thick at the tip; at least a tenth of the module is "
                    "needed); take less backlash or tip relief, more teeth or a smaller pressure angle",
                    2 * half));
}

ToothProfile::Place ToothProfile::turned_back(double px, double py, double shift) const {
  return {std::hypot(px, pitch_ + py), std::atan2(px, pitch_ + py) - shift / pitch_ - thinner_};
}

// Half of the rolled angle squared is the length of an involute over the base radius.
double ToothProfile::involute_length() const {
  return 0.5 * base_ * (roll_end_ * roll_end_ - roll_begin_ * roll_begin_);
}

// P = t (cos a, sin a) on the line of action, t from the pitch point; the flank of the rack is there when it has moved
// by t / cos a - x on the pitch line. A chord over the rolled angles p to p + d is base p d^2 / 8 away from the
// involute, whose radius of curvature is base p: equal steps of p^(3/2) make that equal. Tangents of the base circle
// are normal to the flank: a turn by d / base moves it back by d.
ToothProfile::Place ToothProfile::involute(double u) const {
  const double begin = std::pow(roll_begin_, 1.5),
               roll = std::pow(begin + u * (std::pow(roll_end_, 1.5) - begin), 2.0 / 3);
  const double t = base_ * roll - pitch_ * std::sin(pressure_angle_);
  Place place = turned_back(t * std::cos(pressure_angle_), t * std::sin(pressure_angle_),
                            t / std::cos(pressure_angle_) - flank_x_);
  place[1] -= relief_ * std::max(0.0, (roll - relief_begin_) / (roll_end_ - relief_begin_)) / base_;
  return place;
}

// The normal at angle b of the rounding goes through the pitch point: the middle of the rounding is at y / sin b along
// it.
ToothProfile::Place ToothProfile::fillet(double u) const {
  const double b = 0.5 * std::numbers::pi + u * (pressure_angle_ - 0.5 * std::numbers::pi);
  const double along = corner_y_ / std::sin(b), reach = along - rounding_;
  return turned_back(reach * std::cos(b), reach * std::sin(b), along * std::cos(b) - corner_x_);
}

}  // namespace espalier::dynamics
