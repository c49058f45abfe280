#include "dynamics/model/robots/mjcf.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "dynamics/model/robots/geom_mass.hpp"

namespace espalier::dynamics::model::robots {
namespace {

/// What <flag> switches off.
struct Off {
  bool springs = false, dampers = false, friction = false, limits = false, equalities = false, controls = false,
       control_limits = false;

  /// @param part  a joint or tendon
  template <class Element>
  void clear(Element& part) const {
    if (springs) part.stiffness = 0;
    if (dampers) part.damping = 0;
    if (friction) part.friction = 0;
    if (limits) part.lower.reset(), part.upper.reset();
  }

  void clear(Robot& robot) const {
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    for (Link& link : robot.links)
      for (RobotJoint& j : link.joints) clear(j);
    for (Tendon& t : robot.tendons) clear(t);
    if (equalities)
      for (Equality& q : robot.equalities) q.active = false;
    for (Actuator& a : robot.actuators) {
      if (controls) a.gain = a.bias = {}, a.damping_ratio = 0;
      if (control_limits) a.least_control = -kInfinite, a.largest_control = kInfinite;
    }
  }
};

/// Gravity and what may be switched off.
void read_options(const MjcfText& text, Robot& robot, Off& switched_off) {
  for (const Element& e : text.sections("option")) {
    robot.gravity = e.vector("gravity", robot.gravity);
    if (e.number("density", 0) != 0 || e.number("viscosity", 0) != 0) robot.pass_over("forces of a fluid");
    if (e.has("wind") && !e.vector("wind", Vec3::Zero()).isZero(0)) robot.pass_over("wind");
    const auto all = text.children(e);
    for (const Element& flag : all) {
      if (flag.tag() != "flag") continue;
      const auto off = [&](const char* key) { return flag.text(key) == "disable"; };
      if (off("gravity")) robot.gravity.setZero();
      if (off("contact")) robot.contacts = false;
      if (off("filterparent")) robot.touch_parents = true;
      Off& o = switched_off;
      o.springs |= off("spring") || off("passive");
      o.dampers |= off("damper") || off("passive");
      o.friction |= off("frictionloss") || off("constraint");
      o.limits |= off("limit") || off("constraint");
      o.equalities |= off("equality") || off("constraint");
      o.controls |= off("actuation");
      o.control_limits |= off("clampctrl");
      if (off("constraint")) robot.contacts = false;
    }
  }
}

/// The range of a joint's forces bounds the sum of all that acts along it; here each actuator of the joint keeps to it
/// for itself.
void tell_shared_limits(Robot& robot) {
  std::map<std::string, int> drivers;
  bool everywhere = false;  // something that does not act along joints
  for (const Actuator& a : robot.actuators) {
    everywhere = everywhere || !a.site.empty();
    if (!a.joint.empty()) ++drivers[a.joint];
    for (const Tendon& t : robot.tendons) {
      if (a.tendon.empty() || a.tendon != t.name) continue;
      everywhere = everywhere || !t.pieces.empty();
      for (const auto& [joint, factor] : t.joints) drivers[joint] += 2;
    }
  }
  const bool weightless =
      std::any_of(robot.links.begin(), robot.links.end(), [](const Link& link) { return link.weightless != 0; });
  for (const Link& link : robot.links)
    for (const RobotJoint& j : link.joints) {
      if (!std::isfinite(j.least_force) && !std::isfinite(j.largest_force)) continue;
      if (everywhere || drivers[j.name] > 1)
        robot.pass_over("limits of the sum of what several actuators, tendons or sites exert on a joint");
      if (j.carries_weight && weightless) robot.pass_over("limits of what actuators bear of the weight");
    }
}

}  // namespace

Mass read_inertial(const MjcfText& text, const Element& e) {
  const Attributes a({e});
  Mass m;
  static_cast<void>(e.need("mass"));
  m.mass = e.number("mass", 0);
  if (m.mass < 0) e.fail("'mass' must not be negative");
  if (e.has("fullinertia")) {
    const std::vector<double> i = e.numbers("fullinertia", 6, 6);
    m.inertia << i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2];
  } else if (e.has("diaginertia")) {
    m.inertia = e.vector("diaginertia", Vec3::Zero()).asDiagonal();
  } else {
    e.fail("needs 'diaginertia' or 'fullinertia'");
  }
  return moved(m, text.pose(a));
}

Robot read_mjcf(const XmlFile& file, const RobotOptions& options) {
  const MjcfText text(file);
  Robot robot;
  robot.name = text.root().text("model");
  Off switched_off;
  read_options(text, robot, switched_off);
  read_mjcf_bodies(text, options, robot);
  read_mjcf_parts(text, robot);
  switched_off.clear(robot);
  tell_shared_limits(robot);
  read_mjcf_keyframe(text, options, robot);
  for (const char* tag : {"sensor", "deformable", "extension"})
    for (const Element& section : text.sections(tag)) {
      const auto all = text.children(section);
      if (!all.empty()) robot.pass_over("<" + std::string(tag) + ">", static_cast<int>(all.size()));
    }
  return robot;
}

}  // namespace espalier::dynamics::model::robots
