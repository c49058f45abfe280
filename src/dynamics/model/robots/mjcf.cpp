#include "dynamics/model/robots/mjcf.hpp"

#include <algorithm>

namespace espalier::dynamics::model::robots {
namespace {

/// Gravity and what may be switched off.
void read_options(const MjcfText& text, Robot& robot) {
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
    }
  }
}

}  // namespace

Robot read_mjcf(const XmlFile& file, const RobotOptions& options) {
  const MjcfText text(file);
  Robot robot;
  robot.name = text.root().text("model");
  read_options(text, robot);
  read_mjcf_bodies(text, options, robot);
  read_mjcf_parts(text, robot);
  read_mjcf_keyframe(text, options, robot);
  for (const char* tag : {"sensor", "deformable", "extension"})
    for (const Element& section : text.sections(tag)) {
      const auto all = text.children(section);
      if (!all.empty()) robot.pass_over("<" + std::string(tag) + ">", static_cast<int>(all.size()));
    }
  return robot;
}

}  // namespace espalier::dynamics::model::robots
