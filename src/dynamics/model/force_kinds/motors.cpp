// Torques and forces that are given, between two frames.
#include "dynamics/forces/coordinate_force.hpp"
#include "dynamics/model/force_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

void read_torque_motor(Section& s, ForceSpec& f, const std::string& /*units*/) {
  f.formula = {s.place("torque"), s.state_function("torque")};
}

void read_force_motor(Section& s, ForceSpec& f, const std::string& /*units*/) {
  f.formula = {s.place("force"), s.state_function("force")};
}

template <Relative kind, int axis>
std::unique_ptr<FrameForce> make_motor(const ForceSpec& f, FramePtr a, FramePtr b, const ForceStart& /*start*/) {
  return std::make_unique<CoordinateForce>(f.name, std::move(a), std::move(b), CoordinateForce::Coordinate{kind, axis},
                                           motor_law());
}

}  // namespace

const ForceKind kTorqueMotor = {.type = ForceType::torque_motor,
                                .name = "torque-motor",
                                .read = read_torque_motor,
                                .make = make_motor<Relative::angle, 0>,
                                .has_axis = true,
                                .moments = true};

const ForceKind kForceMotor = {.type = ForceType::force_motor,
                               .name = "force-motor",
                               .read = read_force_motor,
                               .make = make_motor<Relative::along, 2>,
                               .has_axis = true,
                               .directions = true};

}  // namespace espalier::dynamics::model
