#include "dynamics/model/joint_kinds/kind.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {
namespace {

double length_at(const JointStart& start) {
  double length = 0;
  for (std::size_t k = 0; k + 1 < start.frames.size(); ++k)
    length += (start.frames[k + 1].r - start.frames[k].r).norm();
  return length;
}

void read_cable_joint(Section& s, JointSpec& j, Description& /*model*/) {
  j.parameter = read_measure(s, "length", j.measured);
  if (!j.measured && !(j.parameter > 0)) fail(s.place("length"), "must be greater than 0");
}

std::unique_ptr<Joint> make_cable_joint(const JointSpec& j, std::vector<FramePtr> f, const JointStart& start) {
  return cable_joint(j.name, std::move(f), j.measured ? length_at(start) : j.parameter);
}

}  // namespace

std::unique_ptr<CableForce> make_cable_force(const ForceSpec& f, const FrameBuilder& frames) {
  std::vector<FramePtr> places;
  for (const MarkerSpec& marker : f.frames) places.push_back(frames.make(marker));
  const double rest = f.measured ? length_at(start_of(f.frames, frames)) : f.rest;
  const CableForceLaw law{f.stiffness, f.damping, rest, f.friction, f.slip_speed};
  return std::make_unique<CableForce>(f.name, std::move(places), law);
}

const JointKind kCable = {.type = JointType::cable,
                          .name = "cable",
                          .read = read_cable_joint,
                          .make = make_cable_joint,
                          .frames = JointKind::Frames::through,
                          .turns_a = false,
                          .turns_b = false};

CableForce* Mechanism::cable(const std::string& name) const {
  for (CableForce* c : cables)
    if (c->name() == name) return c;
  return nullptr;
}

}  // namespace espalier::dynamics::model
