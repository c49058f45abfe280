#include <cmath>

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

namespace {

class CentreDistance final : public PointFunction {
 public:
  [[nodiscard]] At at(const Vec3& p) const override {
    const double rho = std::hypot(p.x(), p.y());
    const Vec3 radial(p.x() / rho, p.y() / rho, 0);
    Mat3 hessian = -radial * radial.transpose() / rho;
    hessian(0, 0) += 1 / rho;
    hessian(1, 1) += 1 / rho;
    return {rho, radial, hessian};
  }
};

}  // namespace

PairFunctionPtr centre_distance() { return std::make_shared<CentreDistance>(); }

}  // namespace espalier::dynamics
