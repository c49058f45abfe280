// Couplings of two pairs of frames.
#include "dynamics/joints/coupled_slides.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

void read_ratio(Section& s, JointSpec& j, Description& /*model*/) { j.parameter = s.number("ratio"); }

void read_pinion(Section& s, JointSpec& j, Description& /*model*/) { j.parameter = s.number("radius"); }

std::unique_ptr<Joint> make_gear(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return gear_joint(j.name, std::move(f[0]), std::move(f[1]), std::move(f[2]), std::move(f[3]), j.parameter);
}

std::unique_ptr<Joint> make_rack_and_pinion(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return rack_and_pinion(j.name, std::move(f[0]), std::move(f[1]), std::move(f[2]), std::move(f[3]), j.parameter);
}

std::unique_ptr<Joint> make_coupled_slides(const JointSpec& j, std::vector<FramePtr> f, const JointStart& /*start*/) {
  return coupled_slides(j.name, std::move(f[0]), std::move(f[1]), std::move(f[2]), std::move(f[3]), j.parameter);
}

}  // namespace

const JointKind kGear = {.type = JointType::gear,
                         .name = "gear",
                         .read = read_ratio,
                         .make = make_gear,
                         .frames = JointKind::Frames::four,
                         .axes = JointKind::Axes::one,
                         .couples = true,
                         .starts = false};

const JointKind kRackAndPinion = {.type = JointType::rack_and_pinion,
                                  .name = "rack-and-pinion",
                                  .read = read_pinion,
                                  .make = make_rack_and_pinion,
                                  .frames = JointKind::Frames::four,
                                  .axes = JointKind::Axes::one,
                                  .couples = true,
                                  .starts = false};

const JointKind kCoupledSlides = {.type = JointType::coupled_slides,
                                  .name = "coupled-slides",
                                  .read = read_ratio,
                                  .make = make_coupled_slides,
                                  .frames = JointKind::Frames::four,
                                  .axes = JointKind::Axes::one,
                                  .starts = false};

}  // namespace espalier::dynamics::model
