// Springs with their dampers, and bushings.
#include "dynamics/model/force_kinds/kind.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

void read_spring(Section& s, ForceSpec& f, const std::string& /*units*/) {
  f.stiffness = s.number("stiffness", 0);
  f.damping = s.number("damping", 0);
  f.rest = read_measure(s, "rest", f.measured);
  f.preload = s.number("preload", 0);
  if (s.has("actuator")) f.formula = {s.place("actuator"), s.state_function("actuator")};
}

void read_bushing(Section& s, ForceSpec& f, const std::string& /*units*/) {
  f.linear = s.vector("stiffness", Vec3::Zero());
  f.linear_damping = s.vector("damping", Vec3::Zero());
  f.angular = s.vector("angular_stiffness", Vec3::Zero());
  f.angular_damping = s.vector("angular_damping", Vec3::Zero());
}

SpringLaw spring_law(const ForceSpec& f, const ForceStart& start, Relative kind, int axis) {
  SpringLaw law;
  law.stiffness = f.stiffness;
  law.damping = f.damping;
  law.rest = f.measured ? start.measure(kind, axis) : f.rest;
  law.preload = f.preload;
  return law;
}

std::unique_ptr<FrameForce> make_spring(const ForceSpec& f, FramePtr a, FramePtr b, const ForceStart& start) {
  return spring_damper(f.name, std::move(a), std::move(b), spring_law(f, start, Relative::distance, 0));
}

std::unique_ptr<FrameForce> make_axial_spring(const ForceSpec& f, FramePtr a, FramePtr b, const ForceStart& start) {
  return axial_spring(f.name, std::move(a), std::move(b), spring_law(f, start, Relative::along, 2));
}

std::unique_ptr<FrameForce> make_rotational_spring(const ForceSpec& f, FramePtr a, FramePtr b,
                                                   const ForceStart& start) {
  return rotational_spring(f.name, std::move(a), std::move(b), spring_law(f, start, Relative::angle, 0));
}

std::unique_ptr<FrameForce> make_bushing(const ForceSpec& f, FramePtr a, FramePtr b, const ForceStart& /*start*/) {
  return bushing(f.name, std::move(a), std::move(b), {f.linear, f.linear_damping, f.angular, f.angular_damping});
}

}  // namespace

const ForceKind kSpring = {
    .type = ForceType::spring, .name = "spring", .read = read_spring, .make = make_spring, .turns = false};

const ForceKind kAxialSpring = {.type = ForceType::axial_spring,
                                .name = "axial-spring",
                                .read = read_spring,
                                .make = make_axial_spring,
                                .has_axis = true,
                                .directions = true};

const ForceKind kRotationalSpring = {.type = ForceType::rotational_spring,
                                     .name = "rotational-spring",
                                     .read = read_spring,
                                     .make = make_rotational_spring,
                                     .has_axis = true,
                                     .moments = true};

const ForceKind kBushing = {.type = ForceType::bushing,
                            .name = "bushing",
                            .read = read_bushing,
                            .make = make_bushing,
                            .directions = true,
                            .driven = false};

}  // namespace espalier::dynamics::model
