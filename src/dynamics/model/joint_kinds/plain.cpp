// Joints of two frames and nothing else.
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

template <std::unique_ptr<Joint> (*joint)(std::string name, FramePtr a, FramePtr b)>
std::unique_ptr<Joint> make_plain(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return joint(j.name, std::move(f[0]), std::move(f[1]));
}

}  // namespace

const JointKind kFixed = {.type = JointType::fixed,
                          .name = "fixed",
                          .make = make_plain<fixed_joint>,
                          .starts = false,
                          .hold = {.any = true, .x = true, .y = true, .z = true, .turn = JointHold::Turn::all}};

const JointKind kRevolute = {.type = JointType::revolute,
                             .name = "revolute",
                             .make = make_plain<revolute_joint>,
                             .axes = JointKind::Axes::one,
                             .starts = false,
                             .freedom = {.turns = true, .limits = true, .moments = true},
                             .hold = {.any = true, .x = true, .y = true, .z = true, .turn = JointHold::Turn::axis}};

const JointKind kSpherical = {.type = JointType::spherical,
                              .name = "spherical",
                              .make = make_plain<spherical_joint>,
                              .turns_a = false,
                              .turns_b = false,
                              .starts = false,
                              .hold = {.any = true, .x = true, .y = true, .z = true, .turn = JointHold::Turn::free}};

const JointKind kUniversal = {.type = JointType::universal,
                              .name = "universal",
                              .make = make_plain<universal_joint>,
                              .axes = JointKind::Axes::one,
                              .starts = false,
                              .hold = {.any = true, .x = true, .y = true, .z = true, .turn = JointHold::Turn::cross}};

const JointKind kCylindrical = {.type = JointType::cylindrical,
                                .name = "cylindrical",
                                .make = make_plain<cylindrical_joint>,
                                .axes = JointKind::Axes::one,
                                .starts = false,
                                .freedom = {.turns = true, .slides = true, .limits = true, .moments = true},
                                .hold = {.any = true, .x = true, .y = true, .z = false, .turn = JointHold::Turn::axis}};

const JointKind kPrismatic = {.type = JointType::prismatic,
                              .name = "prismatic",
                              .make = make_plain<prismatic_joint>,
                              .axes = JointKind::Axes::one,
                              .starts = false,
                              .freedom = {.slides = true, .limits = true, .moments = true},
                              .hold = {.any = true, .x = true, .y = true, .z = false, .turn = JointHold::Turn::all}};

const JointKind kPlanar = {.type = JointType::planar,
                           .name = "planar",
                           .make = make_plain<planar_joint>,
                           .axes = JointKind::Axes::one,
                           .starts = false,
                           .hold = {.any = true, .x = false, .y = false, .z = true, .turn = JointHold::Turn::axis}};

const JointKind kPointOnLine = {.type = JointType::point_on_line,
                                .name = "point-on-line",
                                .make = make_plain<point_on_line>,
                                .axes = JointKind::Axes::one,
                                .turns_b = false,
                                .starts = false,
                                .freedom = {.slides = true, .limits = true},
                                .hold = {.any = true, .x = true, .y = true, .z = false, .turn = JointHold::Turn::free}};

}  // namespace espalier::dynamics::model
