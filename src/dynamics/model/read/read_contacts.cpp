// The keys of a joint that make forces: limits with stops, and friction.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "dynamics/joints/space_curve.hpp"
#include "dynamics/model/description.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

/// @param length  of an open curve, whose ends are meant where neither limit is given; 0: none
StopLaw read_limits(Section s, double length) {
  StopLaw law;
  law.lower = s.number("lower", law.lower);
  law.upper = s.number("upper", law.upper);
  if (!s.has("lower") && !s.has("upper")) {
    if (length == 0) fail(s.place(), "needs 'lower' or 'upper', or both");
    law.lower = 0;
    law.upper = length;
  }
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

FrictionSpec read_friction(Section s, const JointSpec& joint) {
  FrictionSpec f;
  f.place = s.place();
  const JointFreedom& freedom = joint_kind(joint.type).freedom;
  const bool turns = freedom.turns, slides = freedom.slides || freedom.surface;
  f.curve.dynamic_coefficient = not_negative(s, "coefficient", 0);
  f.curve.static_coefficient = not_negative(s, "static", f.curve.dynamic_coefficient);
  if (f.curve.static_coefficient < f.curve.dynamic_coefficient)
    fail(s.place("static"), "must not be below 'coefficient', that of sliding");
  if (f.curve.static_coefficient > 0) f.curve.slip_speed = s.positive("slip_speed");
  f.curve.stribeck_speed = s.positive("stribeck_speed", 10 * f.curve.slip_speed);
  f.load.preload = not_negative(s, "preload", 0);
  if (turns && (f.curve.static_coefficient > 0 || !slides)) f.radius = s.positive("radius", 1);
  if (turns && f.curve.static_coefficient > 0 && !s.has("radius"))
    fail(f.place,
         joint.type == JointType::screw ? "needs 'radius', that of the thread" : "needs 'radius', that of the pin");
  if (freedom.moments) f.load.bending = lever(s, "bending_arm");
  if (freedom.moments && slides && !turns) f.load.torsion = lever(s, "torsion_arm");
  if (joint.type == JointType::revolute) f.load.axial = not_negative(s, "collar_radius", 0) / f.radius;
  // The thread's force is across it: more than its part along the axis.
  if (joint.type == JointType::screw) f.load.axial = std::hypot(1, joint.parameter / (2 * std::numbers::pi * f.radius));
  if (joint.type == JointType::in_plane) f.load = {f.load.preload, 0, 1};
  if (slides) f.viscous = not_negative(s, "viscous", 0);
  if (turns) f.angular_viscous = not_negative(s, slides ? "angular_viscous" : "viscous", 0);
  s.finish();
  return f;
}

}  // namespace

void read_joint_contacts(Section& joint, JointSpec& out) {
  const JointFreedom& freedom = joint_kind(out.type).freedom;
  if (joint.has("limits") && !freedom.limits)
    fail(joint.place("limits"),
         fmt::format("only {} joints have limits", joints_that([](const JointKind& k) { return k.freedom.limits; })));
  if (joint.has("friction") && !freedom.rubs())
    fail(joint.place("friction"),
         fmt::format("only {} joints have friction", joints_that([](const JointKind& k) { return k.freedom.rubs(); })));
  const double length = out.curve && !out.curve->closed() ? out.curve->length() : 0;
  if (auto s = joint.table("limits")) (freedom.slides ? out.stop : out.angle_stop) = read_limits(*s, length);
  if (joint.has("angle_limits") && !(freedom.turns && freedom.slides))
    fail(joint.place("angle_limits"), "belongs to cylindrical joints and screws; others have 'limits'");
  if (freedom.turns && freedom.slides)
    if (auto s = joint.table("angle_limits")) out.angle_stop = read_limits(*s, 0);
  if (auto s = joint.table("friction")) out.friction = read_friction(*s, out);
  if (out.friction && out.type == JointType::point_on_curve && out.function)
    fail(
        joint.place("friction"),
        "goes with a point that moves freely along its curve; this one is led by 'motion', whose force would press it");
  if (joint.has("armature")) {
    if (out.type != JointType::revolute && out.type != JointType::prismatic)
      fail(joint.place("armature"),
           "belongs to revolute and prismatic joints: the inertia of a rotor that moves with them");
    out.armature = not_negative(joint, "armature", 0);
  }
}

}  // namespace espalier::dynamics::model
