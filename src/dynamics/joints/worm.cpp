#include <cmath>
#include <numbers>

#include "dynamics/joints/rows.hpp"

namespace espalier::dynamics {
namespace {

// How fast the pitch point of the wheel goes round the worm's axis, seen from the worm: it stands at r_w from that
// axis, the wheel's centre at rho = r_w + |R|, on one line. From the speed of the centre and the turn of the wheel
// about z_A,
//   rate = rho / r_w (angle of the centre)' + (1 - rho / r_w) (angle of z_B)'
struct Shares {
  double centre, axis;
  explicit Shares(const WormShape& s)
      : centre((s.worm_radius + std::abs(s.radius)) / s.worm_radius), axis(1 - centre) {}
};

}  // namespace

double WormShape::lead_angle() const { return std::atan(lead / (2 * std::numbers::pi * worm_radius)); }

// A right-handed thread that turns forwards by a turn stands there as if it had gone back by the lead.
std::unique_ptr<Joint> worm_joint(std::string name, FramePtr a, FramePtr b, const WormShape& shape) {
  using namespace joint_rows;
  const Shares shares(shape);
  const double slope = shape.lead / (2 * std::numbers::pi);
  auto joint = make("worm", std::move(name), std::move(a), std::move(b),
                    {coupling({{Relative::along, 2},
                               {Relative::angle, 0, 2, 1, 0, -shape.radius},
                               {Relative::polar, 0, 0, 0, 1, -slope * shares.centre},
                               {Relative::angle, 0, 2, 0, 1, -slope * shares.axis}})});
  joint->name_row_force("tooth_force", 0);
  return joint;
}

PairFunctionPtr worm_slip(const WormShape& shape) {
  const Shares shares(shape);
  const double angle = shape.lead_angle(), round = std::cos(angle) * shape.worm_radius, along = std::sin(angle);
  return std::make_shared<PairSum>(std::vector<PairSum::Term>{{along, {Relative::along, 2}},
                                                              {-along * shape.radius, {Relative::angle, 0, 2}, true},
                                                              {round * shares.centre, {Relative::polar}},
                                                              {round * shares.axis, {Relative::angle, 0, 2}}});
}

}  // namespace espalier::dynamics
