#include "dynamics/model/build/functions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/forces/joint_friction.hpp"
#include "dynamics/model/controllers/controllers.hpp"
#include "dynamics/model/erosion/erosion.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {
namespace {

using SharedFrame = std::shared_ptr<const Frame>;

/// A frame that somebody else owns.
SharedFrame borrowed(const Frame& frame) { return {std::shared_ptr<const Frame>(), &frame}; }

Offer of_frame(const SharedFrame& frame) {
  return {{{"position", motion_of(frame, Motion::position)},
           {"velocity", motion_of(frame, Motion::velocity)},
           {"rotation", motion_of(frame, Motion::rotation)},
           {"angular_velocity", motion_of(frame, Motion::angular_velocity)}},
          {}};
}

bool slides_along_z(const Joint& joint) {
  return joint.kind() == "prismatic" || joint.kind() == "cylindrical" || joint.kind() == "translation motor";
}

/// A multiplier with the other sign: the force on frame b in the direction of the row.
class RowForceFunction final : public StateFunction {
 public:
  explicit RowForceFunction(Index row) : row_(row) { multipliers_.push_back(row); }
  [[nodiscard]] double value(const StateView& s) const override { return -s.lambda[at(row_)]; }

 protected:
  void add_gradient(const StateView& /*s*/, StateGradient& out) const override { out.lambda[0] -= 1; }

 private:
  Index row_;
};

Offer of_joint(const Joint& joint, const JointContacts* contacts) {
  Offer offer{{{"force", reaction_of(joint, 1, false)}, {"moment", reaction_of(joint, 1, true)}}, {}};
  const auto relative = [&](const char* value, const char* rate, Relative kind, int axis, const TurnCounter* turns) {
    for (const bool r : {false, true})
      offer.scalars.emplace_back(r ? rate : value,
                                 relative_quantity({&joint.frame(0), &joint.frame(1), {kind, axis}, turns, r}));
  };
  if (joint.spin()) relative("angle", "angular_speed", Relative::angle, 0, &*joint.spin());
  if (slides_along_z(joint)) relative("displacement", "speed", Relative::along, 2, nullptr);
  for (const JointMotion& motion : joint.motions())
    for (const bool r : {false, true})
      offer.scalars.emplace_back(r ? motion.rate : motion.value,
                                 relative_quantity({&joint.frame(0), &joint.frame(1), motion.coordinate, nullptr, r}));
  for (const auto& [name, row] : joint.row_forces())
    offer.scalars.emplace_back(
        name, scaled(std::make_shared<RowForceFunction>(joint.placement().c + static_cast<Index>(row)), -1));
  for (std::size_t r = 0; r < joint.rows().size(); ++r) {
    static const char* const kNames[] = {"longitudinal_force", "lateral_force", "normal_force"};
    const JointRow::Term& term = joint.rows()[r].terms.front();
    if (!term.rolling) continue;
    offer.scalars.emplace_back(kNames[term.i],
                               std::make_shared<RowForceFunction>(joint.placement().c + static_cast<Index>(r)));
  }
  if (contacts == nullptr) return offer;
  for (const auto& [name, force] :
       {std::pair{"stop_force", contacts->stop}, std::pair{"stop_moment", contacts->angle_stop},
        std::pair{"friction_force", contacts->friction}, std::pair{"friction_moment", contacts->angle_friction}})
    if (force != nullptr) offer.scalars.emplace_back(name, strength_of(*force));
  if (contacts->separation != nullptr)
    offer.scalars.emplace_back("separating_force", scaled(strength_of(*contacts->separation), -1));
  if (contacts->sliding != nullptr)
    offer.scalars.emplace_back("friction_force", component_of(wrench_of(*contacts->sliding, 1, false), 3));
  return offer;
}

Offer of_force(const BuiltForce& built) {
  Offer offer{
      {{"force", wrench_of(*built.force, built.side, false)}, {"moment", wrench_of(*built.force, built.side, true)}},
      {}};
  if (const auto* spring = dynamic_cast<const CoordinateForce*>(built.force)) {
    offer.scalars.emplace_back("coordinate", coordinate_of(*spring, false));
    offer.scalars.emplace_back("rate", coordinate_of(*spring, true));
    offer.scalars.emplace_back("strength", strength_of(*spring));
  }
  return offer;
}

Offer of_cable(const CableForce& cable) {
  using What = CableForce::What;
  Offer offer;
  for (const auto& [name, what] : {std::pair{"tension", What::last_pull}, std::pair{"first_tension", What::first_pull},
                                   std::pair{"length", What::length}, std::pair{"rate", What::rate}})
    offer.scalars.emplace_back(name, cable_quantity(cable, what));
  return offer;
}

class InputFunction final : public StateFunction {
 public:
  explicit InputFunction(const double* value) : value_(value) {}
  [[nodiscard]] double value(const StateView& /*s*/) const override { return *value_; }

 protected:
  void add_gradient(const StateView& /*s*/, StateGradient& /*out*/) const override {}

 private:
  const double* value_;
};

class ConstantFunction final : public StateFunction {
 public:
  explicit ConstantFunction(double value) : value_(value) {}
  [[nodiscard]] double value(const StateView& /*s*/) const override { return value_; }

 protected:
  void add_gradient(const StateView& /*s*/, StateGradient& /*out*/) const override {}

 private:
  double value_;
};

/// The chain rule by one pass through the expression for each of its quantities.
class ExpressionFunction final : public CompositeFunction {
 public:
  ExpressionFunction(const Formula& formula, std::vector<StateFunctionPtr> parts)
      : CompositeFunction(std::move(parts)), formula_(formula) {}
  [[nodiscard]] double value(const StateView& s) const override {
    const double y = evaluate(s).value;
    if (!std::isfinite(y)) refuse("value", s.t);
    return y;
  }
  void branches(const StateView& s, Branches& out) const override {
    CompositeFunction::branches(s, out);
    formula_.expression.branches(s.t, jets_of(s), out);
  }

 protected:
  void add_gradient(const StateView& s, StateGradient& out) const override {
    std::vector<Jet> jets = jets_of(s);
    for (std::size_t k = 0; k < jets.size(); ++k) {
      if (parts()[k]->coordinates().empty() && parts()[k]->multipliers().empty()) continue;
      jets[k].rate = 1;
      const double slope = formula_.expression.evaluate({s.t, 0, 0}, jets).rate;
      jets[k].rate = 0;
      if (!std::isfinite(slope)) refuse("derivative by " + formula_.expression.quantities()[k].name, s.t);
      add_part(s, k, slope, out);
    }
  }

 private:
  [[nodiscard]] std::vector<Jet> jets_of(const StateView& s) const {
    std::vector<Jet> jets;
    for (const StateFunctionPtr& part : parts()) jets.push_back({part->value(s), 0, 0});
    return jets;
  }
  [[nodiscard]] Jet evaluate(const StateView& s) const {
    const std::vector<Jet> jets = jets_of(s);
    try {
      return formula_.expression.evaluate({s.t, 0, 0}, jets);
    } catch (const Error& error) {  // of a spline
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: {} (at t = {:g})", formula_.place.text(), error.what(), s.t));
    }
  }
  [[noreturn]] void refuse(const std::string& what, double t) const {
    throw Error(StatusCode::invalid_input, fmt::format("{}: the {} of \"{}\" is not a finite number at t = {:g}",
                                                       formula_.place.text(), what, formula_.expression.text(), t));
  }

  Formula formula_;
};

/// How many of its elements have failed, where they can.
Offer of_flexible_body(const Mechanism& mechanism, const std::string& body) {
  const double* failed = mechanism.erosion == nullptr ? nullptr : mechanism.erosion->failed_elements(body);
  if (failed == nullptr) return {};
  return {{}, {{"failed_elements", std::make_shared<InputFunction>(failed)}}};
}

}  // namespace

std::optional<Offer> functions_of(const Mechanism& mechanism, const std::string& object) {
  if (const BuiltBody* body = mechanism.body(object)) {
    if (body->rigid != nullptr) return of_frame(std::make_shared<RigidFrame>(*body->rigid));
    if (body->point == nullptr) return of_flexible_body(mechanism, object);
    const auto frame = std::make_shared<PointFrame>(*body->point);
    return Offer{{{"position", motion_of(frame, Motion::position)}, {"velocity", motion_of(frame, Motion::velocity)}},
                 {}};
  }
  if (const Frame* frame = frame_named(mechanism, object)) return of_frame(borrowed(*frame));
  if (const Joint* joint = mechanism.joint(object)) {
    const auto it = mechanism.contacts.find(object);
    return of_joint(*joint, it == mechanism.contacts.end() ? nullptr : &it->second);
  }
  if (const Support* support = mechanism.support(object))
    return Offer{{{"force", reaction_of(*support, false)}, {"moment", reaction_of(*support, true)}}, {}};
  if (const BuiltForce* force = mechanism.force(object)) return of_force(*force);
  if (const CableForce* cable = mechanism.cable(object)) return of_cable(*cable);
  if (const FacePressure* pressure = mechanism.pressure(object))
    return Offer{{}, {{pressure->faces().value_name(), pressure_of(*pressure)}}};
  if (mechanism.surface_contact(object) != nullptr) return Offer{};
  if (mechanism.controllers != nullptr)
    if (const Controllers::Controller* part = mechanism.controllers->part(object)) {
      Offer offer;
      for (const auto& output : part->outputs)
        offer.scalars.emplace_back(output.name, std::make_shared<InputFunction>(&output.value));
      return offer;
    }
  if (object == "sensors") return Offer{{}, mechanism.sensors};
  if (object != "inputs") return std::nullopt;
  Offer offer;
  if (mechanism.controls != nullptr)
    for (const auto& input : mechanism.controls->inputs)
      offer.scalars.emplace_back(input.first, std::make_shared<InputFunction>(&input.second));
  return offer;
}

std::vector<std::string> object_names(const Mechanism& mechanism) {
  std::vector<std::string> names;
  for (const BuiltBody& b : mechanism.bodies) names.push_back(b.spec.name);
  for (const auto& [name, frame] : mechanism.markers) names.push_back(name);
  for (const Joint* j : mechanism.joints) names.push_back(j->name());
  for (const Support* s : mechanism.supports) names.push_back(s->name());
  for (const BuiltForce& f : mechanism.forces) names.push_back(f.force->name());
  for (const FacePressure* p : mechanism.pressures) names.push_back(p->name());
  for (const CableForce* c : mechanism.cables) names.push_back(c->name());
  for (const BuiltContact& c : mechanism.surface_contacts) names.push_back(c.name);
  if (mechanism.controllers != nullptr)
    for (const auto& part : mechanism.controllers->parts()) names.push_back(part->name);
  if (!mechanism.sensors.empty()) names.emplace_back("sensors");
  if (mechanism.controls != nullptr && !mechanism.controls->inputs.empty()) names.emplace_back("inputs");
  return names;
}

std::vector<std::string> split_name(const std::string& request) {
  std::vector<std::string> parts(1);
  for (const char c : request) {
    if (c == '.') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

std::vector<std::string> split_name(const Mechanism& mechanism, const std::string& request) {
  std::vector<std::string> parts = split_name(request);
  if (parts.size() < 2 || parts[1].size() != 1) return parts;
  const std::string object = parts[0] + "." + parts[1];
  if (frame_named(mechanism, object) == nullptr) return parts;
  parts.erase(parts.begin());
  parts[0] = object;
  return parts;
}

const Frame* frame_named(const Mechanism& mechanism, const std::string& object) {
  if (const auto it = mechanism.markers.find(object); it != mechanism.markers.end()) return it->second.get();
  const std::size_t dot = object.rfind('.');
  if (dot == std::string::npos || dot + 2 != object.size()) return nullptr;
  const std::string name = object.substr(0, dot);
  const int which = object.back() - 'a';
  if (const Joint* joint = mechanism.joint(name))
    return which >= 0 && which < joint->frames() ? &joint->frame(which) : nullptr;
  if (const BuiltForce* force = mechanism.force(name))
    return which == 0 || which == force->side ? &force->force->frame(which) : nullptr;
  if (const CableForce* cable = mechanism.cable(name))
    return which >= 0 && which < cable->frames() ? &cable->frame(which) : nullptr;
  return nullptr;
}

StateFunctionPtr find_function(const Mechanism& mechanism, const std::string& request) {
  const auto refuse = [&](const std::string& what) {
    throw Error(StatusCode::invalid_input, fmt::format("\"{}\": {}", request, what));
  };
  const std::vector<std::string> parts = split_name(mechanism, request);
  const std::optional<Offer> offer = functions_of(mechanism, parts[0]);
  if (!offer)
    refuse(fmt::format("there is no body, marker, joint, support or force '{}'{}", parts[0],
                       suggestion(parts[0], object_names(mechanism))));
  const std::string what = parts.size() > 1 ? parts[1] : "";
  for (const auto& [name, function] : offer->scalars)
    if (name == what && parts.size() == 2) return function;
  static const std::vector<std::string> kComponents = {"x", "y", "z", "norm"};
  for (const auto& [name, function] : offer->vectors) {
    if (name != what) continue;
    const auto it = std::find(kComponents.begin(), kComponents.end(), parts.size() == 3 ? parts[2] : "");
    if (it == kComponents.end()) refuse("is a vector; add .x, .y, .z or .norm");
    return component_of(function, static_cast<int>(it - kComponents.begin()));
  }
  std::vector<std::string> known;
  for (const auto& [name, function] : offer->scalars) known.push_back(name);
  for (const auto& [name, function] : offer->vectors) known.push_back(name);
  if (const BuiltBody* body = mechanism.body(parts[0]); body != nullptr && body->flexible != nullptr)
    refuse(fmt::format("expressions know flexible bodies by markers on them; give '{}' one", parts[0]));
  if (mechanism.surface_contact(parts[0]) != nullptr)
    refuse("what a contact says goes to outputs; expressions take no part of it");
  refuse(fmt::format("'{}' has no '{}' for expressions{}", parts[0], what, suggestion(what, known)));
  return nullptr;
}

StateFunctionPtr expression_function(const Formula& formula, std::vector<StateFunctionPtr> parts) {
  return std::make_shared<ExpressionFunction>(formula, std::move(parts));
}

StateFunctionPtr constant_function(double value) { return std::make_shared<ConstantFunction>(value); }

}  // namespace espalier::dynamics::model
