// The keys of a joint that make forces: limits with stops, and friction.
#include <fmt/format.h>

#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {
namespace {

StopLaw read_limits(Section s) {
  StopLaw law;
  law.lower = s.number("lower", law.lower);
  law.upper = s.number("upper", law.upper);
  if (!s.has("lower") && !s.has("upper")) fail(s.place(), "needs 'lower' or 'upper', or both");
  if (!(law.lower < law.upper))
    fail(s.place("upper"), fmt::format("must be greater than 'lower', {:g}, not {:g}", law.lower, law.upper));
  law.stiffness = s.positive("stiffness");
  law.smoothing = s.positive("smoothing");
  law.damping = s.number("damping", 0);
  if (law.damping < 0) fail(s.place("damping"), "must not be negative");
  s.finish();
  return law;
}

double not_negative(Section& s, const std::string& key, double otherwise) {
  const double value = s.number(key, otherwise);
  if (value < 0) fail(s.place(key), fmt::format("must not be negative, but is {:g}", value));
  return value;
}

/// 1 / length, or 0 without the key: moments then do not press.
double lever(Section& s, const std::string& key) { return s.has(key) ? 1 / s.positive(key) : 0.0; }

FrictionSpec read_friction(Section s, JointType type) {
  FrictionSpec f;
  f.place = s.place();
  const bool turns = type != JointType::prismatic, slides = type != JointType::revolute;
  f.curve.dynamic_coefficient = not_negative(s, "coefficient", 0);
  f.curve.static_coefficient = not_negative(s, "static", f.curve.dynamic_coefficient);
  if (f.curve.static_coefficient < f.curve.dynamic_coefficient)
    fail(s.place("static"), "must not be below 'coefficient', that of sliding");
  if (f.curve.static_coefficient > 0) f.curve.slip_speed = s.positive("slip_speed");
  f.curve.stribeck_speed = s.positive("stribeck_speed", 10 * f.curve.slip_speed);
  f.load.preload = not_negative(s, "preload", 0);
  if (turns && (f.curve.static_coefficient > 0 || !slides)) f.radius = s.positive("radius", 1);
  if (turns && f.curve.static_coefficient > 0 && !s.has("radius")) fail(f.place, "needs 'radius', that of the pin");
  f.load.bending = lever(s, "bending_arm");
  if (slides && !turns) f.load.torsion = lever(s, "torsion_arm");
  if (type == JointType::revolute) f.load.axial = not_negative(s, "collar_radius", 0) / f.radius;
  if (slides) f.viscous = not_negative(s, "viscous", 0);
  if (turns) f.angular_viscous = not_negative(s, slides ? "angular_viscous" : "viscous", 0);
  s.finish();
  return f;
}

}  // namespace

void read_joint_contacts(Section& joint, JointSpec& out) {
  const bool turns = out.type == JointType::revolute || out.type == JointType::cylindrical;
  const bool slides = out.type == JointType::prismatic || out.type == JointType::cylindrical;
  for (const char* key : {"limits", "angle_limits", "friction"})
    if (joint.has(key) && !turns && !slides)
      fail(joint.place(key), "only revolute, prismatic and cylindrical joints have limits and friction");
  if (auto s = joint.table("limits")) (slides ? out.stop : out.angle_stop) = read_limits(*s);
  if (joint.has("angle_limits") && !(turns && slides))
    fail(joint.place("angle_limits"), "belongs to cylindrical joints; others have 'limits'");
  if (turns && slides)
    if (auto s = joint.table("angle_limits")) out.angle_stop = read_limits(*s);
  if (joint.has("armature")) {
    if (turns == slides)
      fail(joint.place("armature"),
           "belongs to revolute and prismatic joints: the inertia of a rotor that moves with them");
    out.armature = not_negative(joint, "armature", 0);
  }
  if (auto s = joint.table("friction")) out.friction = read_friction(*s, out.type);
}

}  // namespace espalier::dynamics::model
