#include "dynamics/model/force_kinds/kind.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

void read_cable_force(Section& s, ForceSpec& f, const std::string& /*units*/) {
  f.stiffness = s.positive("stiffness");
  f.damping = s.number("damping", 0);
  f.rest = read_measure(s, "length", f.measured);
  if (!f.measured && !(f.rest > 0)) fail(s.place("length"), "must be greater than 0");
  f.friction = s.number("friction", 0);
  if (f.damping < 0) fail(s.place("damping"), "must not be negative");
  if (f.friction < 0) fail(s.place("friction"), "must not be negative");
  f.slip_speed = f.friction > 0 ? s.positive("slip_speed") : s.positive("slip_speed", 1);
}

}  // namespace

const ForceKind kCableForce = {.type = ForceType::cable,
                               .name = "cable",
                               .read = read_cable_force,
                               .frames = ForceKind::Frames::through,
                               .turns = false,
                               .driven = false};

}  // namespace espalier::dynamics::model
