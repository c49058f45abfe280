#include "dynamics/forces/guide.hpp"

#include "dynamics/model/force_kinds/kind.hpp"
#include "dynamics/model/units/unit_system.hpp"

namespace espalier::dynamics::model {
namespace {

void read_guide(Section& s, ForceSpec& f, const std::string& units) {
  f.stiffness = s.positive("stiffness");
  f.damping = s.number("damping", 0);
  f.friction = s.number("friction", 0);
  f.slip_speed = s.positive("slip_speed", in_units(units, 1e-2, "m/s"));
  f.smoothing = s.positive("smoothing");
  f.both_sides = s.flag("both_sides", false);
  f.start = s.vector("start", Vec3::Zero());
  f.direction = s.number("direction", 0);
  const std::vector<double> lengths = s.numbers("lengths"), curvatures = s.numbers("curvatures");
  if (lengths.empty() || lengths.size() != curvatures.size())
    fail(s.place("curvatures"), "'lengths' and 'curvatures' need one number for each piece of the guide");
  for (std::size_t k = 0; k < lengths.size(); ++k) {
    if (!(lengths[k] > 0)) fail(s.place("lengths"), "must be greater than 0");
    f.segments.push_back({lengths[k], curvatures[k]});
  }
}

std::unique_ptr<FrameForce> make_guide(const ForceSpec& f, FramePtr a, FramePtr b, const ForceStart& /*start*/) {
  GuideLaw law;
  law.path = GuidePath(f.start, f.direction);
  for (const GuideSegment& s : f.segments) law.path.add(s.length, s.curvature);
  law.stiffness = f.stiffness;
  law.damping = f.damping;
  law.friction = f.friction;
  law.slip_speed = f.slip_speed;
  law.smoothing = f.smoothing;
  law.both_sides = f.both_sides;
  return guide(f.name, std::move(a), std::move(b), law);
}

}  // namespace

const ForceKind kGuide = {.type = ForceType::guide,
                          .name = "guide",
                          .read = read_guide,
                          .make = make_guide,
                          .directions = true,
                          .driven = false};

}  // namespace espalier::dynamics::model
