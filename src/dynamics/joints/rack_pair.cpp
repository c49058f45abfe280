#include "dynamics/joints/rows.hpp"

namespace espalier::dynamics {

// At the pitch point, radius n from the centre with n = z_A x z_B, the pinion moves along z_A as its centre does and by
// radius theta' more. z_A stands at the angle beta = const - theta in the axes of the pinion.
std::unique_ptr<Joint> rack_pair(std::string name, FramePtr a, FramePtr b, double radius) {
  using namespace joint_rows;
  auto joint = make("rack pair", std::move(name), std::move(a), std::move(b),
                    {coupling({{Relative::along, 2}, {Relative::angle, 0, 2, 1, 0, -radius}})});
  joint->name_row_force("tooth_force", 0);
  return joint;
}

namespace {

class DistanceAlong final : public PointFunction {
 public:
  explicit DistanceAlong(const Vec3& direction) : direction_(direction) {}
  [[nodiscard]] At at(const Vec3& p) const override { return {direction_.dot(p), direction_, Mat3::Zero()}; }

 private:
  Vec3 direction_;
};

}  // namespace

PairFunctionPtr distance_along(const Vec3& direction) { return std::make_shared<DistanceAlong>(direction); }

}  // namespace espalier::dynamics
