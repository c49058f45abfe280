// Inputs of forces, sensors, conditions of events: expressions over quantities, each made after those it needs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "dynamics/bodies/rotor_inertia.hpp"
#include "dynamics/forces/sliding_friction.hpp"
#include "dynamics/joints/coupled_slides.hpp"
#include "dynamics/joints/surface_shape.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/build/functions.hpp"
#include "dynamics/model/controllers/controllers.hpp"
#include "dynamics/model/force_kinds/kind.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"
#include "dynamics/model/joint_kinds/wheels.hpp"

namespace espalier::dynamics::model {
namespace {

/// Not negative while a contact is closed, or open. Events look at its value alone.
class ContactCondition final : public StateFunction {
 public:
  ContactCondition(const BuiltContact& contact, bool opens) : parts_(contact.parts), sign_(opens ? 1 : -1) {}
  [[nodiscard]] double value(const StateView& s) const override {
    double least = std::numeric_limits<double>::infinity();
    for (contact::Contact* part : parts_) least = std::min(least, part->gap(s));
    return sign_ * least;
  }

 private:
  void add_gradient(const StateView& /*s*/, StateGradient& /*out*/) const override {
    throw std::logic_error("a contact's gap has no gradient");
  }

  std::vector<contact::Contact*> parts_;
  double sign_;
};

/// A function with what [harmonic] adds to it.
class DrivenFunction final : public CompositeFunction {
 public:
  DrivenFunction(StateFunctionPtr function, std::shared_ptr<const double> drive)
      : CompositeFunction({std::move(function)}), drive_(std::move(drive)) {}
  [[nodiscard]] double value(const StateView& s) const override { return parts().front()->value(s) + *drive_; }

 private:
  void add_gradient(const StateView& s, StateGradient& out) const override { add_part(s, 0, 1, out); }

  std::shared_ptr<const double> drive_;
};

class FunctionBuilder {
 public:
  FunctionBuilder(const Description& model, Mechanism& out) : model_(model), out_(out) {}

  void run() {
    for (const ForceSpec& force : model_.forces) need_force(force);
    for (const auto& sensor : model_.sensors) need_sensor(sensor.first);
    for (std::size_t k = 0; k < model_.controllers.size(); ++k)
      for (const auto& [variable, formula] : model_.controllers[k].inputs)
        out_.controllers->parts()[k]->inputs.push_back(make(formula));
    for (const EventSpec& event : model_.events) {
      out_.conditions.push_back(event.condition ? make(*event.condition) : contact_condition(event));
      out_.settings.emplace_back();
      for (const auto& [input, value] : event.set) out_.settings.back().push_back(make(value));
    }
  }

 private:
  /// The objects whose functions are being made, in the order in which one asks for the next.
  class Asking {
   public:
    Asking(std::vector<std::string>& way, const std::string& name, const Place& place) : way_(way) {
      const auto it = std::find(way.begin(), way.end(), name);
      if (it != way.end()) {
        std::string circle;
        for (auto at = it; at != way.end(); ++at) circle += *at + " -> ";
        fail(place, fmt::format("depends on itself: {}{}; a force or sensor may not need its own value", circle, name));
      }
      way.push_back(name);
    }
    ~Asking() { way_.pop_back(); }
    Asking(const Asking&) = delete;
    Asking& operator=(const Asking&) = delete;

   private:
    std::vector<std::string>& way_;
  };

  [[nodiscard]] StateFunctionPtr contact_condition(const EventSpec& event) const {
    return std::make_shared<ContactCondition>(*out_.surface_contact(event.contact), event.opens);
  }

  StateFunctionPtr make(const Formula& formula) {
    std::vector<StateFunctionPtr> parts;
    for (const Expression::Unknown& wanted : formula.expression.quantities()) {
      const std::vector<std::string> name = split_name(wanted.name);
      if (name[0] == "sensors" && name.size() == 2) need_sensor(name[1]);
      // A spring's length does not need its strength: springs and motors may depend on their own coordinate and frames.
      const bool own_motion = name.size() == 2 && (name[1] == "coordinate" || name[1] == "rate");
      const bool own_frame = name.size() > 2 && name[1].size() == 1;
      if (!own_motion && !own_frame)
        for (const ForceSpec& force : model_.forces)
          if (force.name == name[0]) need_force(force);
      try {
        parts.push_back(find_function(out_, wanted.name));
      } catch (const Error& error) {
        fail(formula.place, wanted.complaint + error.what());
      }
    }
    return expression_function(formula, std::move(parts));
  }

  void need_force(const ForceSpec& spec) {
    if (spec.type == ForceType::cable) return;  // it depends on its frames alone
    if (std::find(done_.begin(), done_.end(), spec.name) != done_.end()) return;
    const Asking asking(way_, spec.name, spec.place);
    std::vector<StateFunctionPtr> inputs;
    for (const auto& component : spec.components)
      if (component) inputs.push_back(make(*component));
    const auto drive = out_.drives.find(spec.name);
    if (drive != out_.drives.end()) {
      const double otherwise = force_kind(spec.type).factor;
      inputs.push_back(std::make_shared<DrivenFunction>(
          spec.formula ? make(*spec.formula) : constant_function(otherwise), drive->second));
    } else if (spec.formula) {
      inputs.push_back(make(*spec.formula));
    }
    if (FacePressure* pressure = out_.pressure(spec.name))
      pressure->set_pressure(inputs.empty() ? constant_function(1) : std::move(inputs.front()));
    else
      out_.force(spec.name)->force->set_inputs(std::move(inputs));
    done_.push_back(spec.name);
  }

  void need_sensor(const std::string& name) {
    const auto known = [&](const auto& entry) { return entry.first == name; };
    if (std::any_of(out_.sensors.begin(), out_.sensors.end(), known)) return;
    const auto it = std::find_if(model_.sensors.begin(), model_.sensors.end(), known);
    if (it == model_.sensors.end()) return;
    const Asking asking(way_, "sensors." + name, it->second.place);
    StateFunctionPtr made = make(it->second);
    out_.sensors.emplace_back(name, std::move(made));
  }

  const Description& model_;
  Mechanism& out_;
  std::vector<std::string> way_, done_;
};

/// Where limits and friction of a joint act, beside the plain displacement and angle.
PairCoordinate coordinate_of_joint(const Joint& joint, std::string_view name, const PairCoordinate& otherwise) {
  const PairCoordinate* own = joint.motion(name);
  return own != nullptr ? *own : otherwise;
}

PairCoordinate slide_along_z() { return {Relative::along, 2}; }
PairCoordinate turn_about_z() { return {Relative::angle, 2}; }

StateFunctionPtr friction_load_of(const JointSpec& spec, const Joint& joint, const JointStart& start) {
  const FrictionSpec& f = *spec.friction;
  if (joint_kind(spec.type).freedom.whole_force) return friction_load_of_force(joint, f.load.preload);
  const auto of_tooth = [&](double angle) {
    return friction_load_of_row(joint, 0, 1 / std::cos(angle), f.load.preload);
  };
  if (spec.type == JointType::worm) return of_tooth(worm_shape(spec, start).lead_angle());
  if (has_spur_teeth(spec.type)) return of_tooth(spec.pressure_angle);
  return friction_load(joint, f.load);
}

void add_friction(const JointSpec& spec, const FrameBuilder& frames, Joint& joint, Mechanism& out) {
  const FrictionSpec& f = *spec.friction;
  const JointFreedom freedom = joint_kind(spec.type).freedom;
  const JointStart start = start_of(spec.frames, frames);
  const StateFunctionPtr load = friction_load_of(spec, joint, start);
  JointContacts& contacts = out.contacts[spec.name];
  if (freedom.surface) {
    auto force = sliding_friction(spec.name + " friction", frames.make(spec.frames[0]), frames.make(spec.frames[1]),
                                  spec.surface ? spec.surface : plane_surface(), f.curve, f.viscous);
    force->set_inputs({load});
    contacts.sliding = &out.system.add(std::move(force));
    return;
  }
  const auto rate = [&](const PairCoordinate& coordinate, double radius) {
    return scaled(relative_quantity({&joint.frame(0), &joint.frame(1), coordinate, nullptr, true}), radius);
  };
  const auto add = [&](const char* what, const PairCoordinate& coordinate, const FrictionLaw& law,
                       std::vector<StateFunctionPtr> inputs) {
    auto force = std::make_unique<CoordinateForce>(spec.name + " " + what, frames.make(spec.frames[0]),
                                                   frames.make(spec.frames[1]), coordinate, friction_law(law));
    force->set_inputs(std::move(inputs));
    return &out.system.add(std::move(force));
  };
  PairCoordinate slide = coordinate_of_joint(joint, "displacement", slide_along_z());
  if (spec.type == JointType::worm) slide.function = worm_slip(worm_shape(spec, start));
  if (has_spur_teeth(spec.type)) slide = pitch_line(spec, start);
  std::vector<StateFunctionPtr> along = {load}, about = {load};
  if (freedom.turns && freedom.slides) {
    along.push_back(rate(turn_about_z(), f.radius));
    about.push_back(rate(slide_along_z(), 1));
  }
  if (freedom.slides) contacts.friction = add("friction", slide, {f.curve, 1, f.viscous}, along);
  if (freedom.turns)
    contacts.angle_friction = add("angular friction", turn_about_z(), {f.curve, f.radius, f.angular_viscous}, about);
}

/// Teeth at a pressure angle press the wheels apart by tan(angle) times the force along the pitch line.
void add_separation(const JointSpec& spec, const FrameBuilder& frames, const Joint& joint, Mechanism& out) {
  const Separation apart = separation_of(spec, start_of(spec.frames, frames));
  auto force = std::make_unique<CoordinateForce>(spec.name + " separating force", frames.make(spec.frames[0]),
                                                 frames.make(spec.frames[1]), apart.coordinate, motor_law());
  force->set_inputs({scaled(friction_load_of_row(joint, 0, std::tan(spec.pressure_angle), 0), apart.factor)});
  out.contacts[spec.name].separation = &out.system.add(std::move(force));
}

/// Rate of a joint's coordinate at the start, about or along z of its frame a.
double initial_rate(const JointSpec& spec, const FrameBuilder& frames) {
  const FrameMotion a = frames.initial_motion(spec.frames[0]), b = frames.initial_motion(spec.frames[1]);
  const Vec3 rate =
      spec.type == JointType::revolute ? Vec3(b.omega - a.omega) : Vec3(b.vel - a.vel - a.omega.cross(b.r - a.r));
  return rate.dot(a.rot.col(2));
}

/// The rotor has a coordinate of its own, which follows that of the joint; from the start on: a rotor that is heavy
/// beside its body would hold the body's velocity else.
void add_armature(const JointSpec& spec, const FrameBuilder& frames, Mechanism& out) {
  const auto& rotor =
      out.system.add(std::make_unique<RotorInertia>(spec.name, spec.armature, initial_rate(spec, frames)));
  const auto frame = [&](std::size_t k) { return frames.make(spec.frames[k]); };
  FramePtr ground = std::make_unique<GroundFrame>(), at_rotor = std::make_unique<RotorFrame>(rotor);
  const std::string name = spec.name + " armature";
  if (spec.type == JointType::revolute)
    out.system.add(rack_and_pinion(name, frame(0), frame(1), std::move(ground), std::move(at_rotor), 1));
  else
    out.system.add(coupled_slides(name, frame(0), frame(1), std::move(ground), std::move(at_rotor), -1));
}

}  // namespace

void build_functions(const Description& model, Mechanism& out) { FunctionBuilder(model, out).run(); }

void build_contacts(const JointSpec& spec, const FrameBuilder& frames, Joint& joint, Mechanism& out) {
  const auto add_stop = [&](const char* what, const PairCoordinate& coordinate, const StopLaw& law) {
    return &out.system.add(std::make_unique<CoordinateForce>(spec.name + " " + what, frames.make(spec.frames[0]),
                                                             frames.make(spec.frames[1]), coordinate, stop_law(law)));
  };
  if (spec.stop)
    out.contacts[spec.name].stop =
        add_stop("stop", coordinate_of_joint(joint, "displacement", slide_along_z()), *spec.stop);
  if (spec.angle_stop)
    out.contacts[spec.name].angle_stop =
        add_stop("angular stop", coordinate_of_joint(joint, "bend_angle", turn_about_z()), *spec.angle_stop);
  if (spec.friction) add_friction(spec, frames, joint, out);
  if (spec.pressure_angle > 0) add_separation(spec, frames, joint, out);
  if (spec.armature > 0) add_armature(spec, frames, out);
}

void build_controls(const Description& model, Mechanism& out) {
  const auto switched = [&](const std::string& name, bool active) {
    const auto names = [&](const EventSpec& e) {
      return std::count(e.on.begin(), e.on.end(), name) + std::count(e.off.begin(), e.off.end(), name) > 0;
    };
    return !active || std::any_of(model.events.begin(), model.events.end(), names);
  };
  auto controls = std::make_unique<Controls>();
  controls->inputs = model.inputs;
  controls->events.resize(model.events.size());
  for (const JointSpec& spec : model.joints) {
    if (!switched(spec.name, spec.active)) continue;
    Switch s{spec.name, out.joint(spec.name), {}, nullptr, spec.active};
    if (const auto it = out.contacts.find(spec.name); it != out.contacts.end())
      for (FrameForce* f :
           std::initializer_list<FrameForce*>{it->second.stop, it->second.angle_stop, it->second.friction,
                                              it->second.angle_friction, it->second.sliding, it->second.separation})
        if (f != nullptr) s.forces.push_back(f);
    controls->switches.push_back(std::move(s));
  }
  for (const ForceSpec& spec : model.forces) {
    if (!switched(spec.name, spec.active)) continue;
    Switch s{spec.name, nullptr, {}, out.pressure(spec.name), spec.active};
    if (const BuiltForce* built = out.force(spec.name)) s.forces.push_back(built->force);
    s.cable = out.cable(spec.name);
    controls->switches.push_back(std::move(s));
  }
  for (const ContactSpec& spec : model.contacts)
    if (switched(spec.name, spec.active))
      controls->switches.push_back(
          {spec.name, nullptr, {}, nullptr, spec.active, out.surface_contact(spec.name)->parts});
  if (controls->inputs.empty() && controls->switches.empty() && controls->events.empty()) return;
  controls->apply();
  out.controls = &out.system.add(std::move(controls));
}

}  // namespace espalier::dynamics::model
