#include "dynamics/joints/rows.hpp"

namespace espalier::dynamics {

// The line of centres, at the angle psi, stands at psi - theta_A in the axes of A and at psi + pi - theta_B in those of
// B. Pitch circles roll: R_A (theta_A - psi)' + R_B (theta_B - psi)' = 0.
std::unique_ptr<Joint> gear_pair(std::string name, FramePtr a, FramePtr b, double radius_a, double radius_b) {
  using namespace joint_rows;
  auto joint = make("gear pair", std::move(name), std::move(a), std::move(b),
                    {coupling({{Relative::polar, 0, 0, 0, 1, radius_a}, {Relative::polar, 0, 0, 1, 0, radius_b}})});
  joint->name_row_force("tooth_force", 0);
  return joint;
}

}  // namespace espalier::dynamics
