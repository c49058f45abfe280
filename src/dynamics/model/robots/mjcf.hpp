/// \file
/// Robots of MuJoCo: MJCF.
#pragma once

#include "dynamics/model/robots/mjcf_defaults.hpp"
#include "dynamics/model/robots/robot.hpp"

namespace espalier::dynamics::model::robots {

/// @throws Error(invalid_input) "file:line: ..."
[[nodiscard]] Robot read_mjcf(const XmlFile& file, const RobotOptions& options);

/// The links, joints, geoms and sites of <worldbody>. @param tree  gravity of it is known
void read_mjcf_bodies(const MjcfText& text, const RobotOptions& options, Robot& robot);
/// Actuators, tendons, equalities, exclusions of contacts. @pre the bodies are read
void read_mjcf_parts(const MjcfText& text, Robot& robot);
/// Coordinates, speeds and controls of the keyframe that the options name.
void read_mjcf_keyframe(const MjcfText& text, const RobotOptions& options, Robot& robot);

/// Place of a link with all joints at their `ref`.
[[nodiscard]] Pose pose_at_ref(const Robot& robot, int link);

/// <inertial> of a body.
[[nodiscard]] Mass read_inertial(const MjcfText& text, const Element& e);

}  // namespace espalier::dynamics::model::robots
