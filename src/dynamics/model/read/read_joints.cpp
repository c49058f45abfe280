// The sections [markers], [joints] and [forces].
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/model/description.hpp"
#include "dynamics/model/frames/names.hpp"
#include "dynamics/model/frames/read_marker.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"
#include "dynamics/model/units/unit_system.hpp"

namespace espalier::dynamics::model {
namespace {

MarkerSpec global_marker(const Place& place, const std::string& body, const Vec3& point, const Mat3& axes) {
  MarkerSpec m;
  m.place = place;
  m.body = body;
  m.point = point;
  m.axes = axes;
  m.global = true;
  return m;
}

/// Frames a and b (and c and d), or the short form bodies = [..], at = [..], axis = [..] in global axes.
std::vector<MarkerSpec> read_frames(Section& s, std::size_t count) {
  std::vector<MarkerSpec> frames;
  if (s.has("bodies")) {
    const std::vector<std::string> bodies = s.texts("bodies");
    if (count != 2 || bodies.size() != 2)
      fail(s.place("bodies"), "must be a list of two names (or give frames a, b, ...)");
    const Vec3 at = s.vector("at");
    bool given = false;
    const Mat3 axes = read_axes(s, given);
    for (const std::string& body : bodies) {
      frames.push_back(global_marker(s.place("bodies"), body, at, axes));
      frames.back().axis_given = given;
    }
    return frames;
  }
  for (const char* key : {"at", "axis", "x_axis", "rotation"})
    if (s.has(key))
      fail(
          s.place(key),
          "goes with bodies = [..]; beside frames a and b it belongs into one of them: a = { body = ..., point = [..], "
          "axis = [..] }");
  static const char* const kKeys[] = {"a", "b", "c", "d"};
  for (std::size_t k = 0; k < count; ++k) {
    const Value* value = s.value(kKeys[k]);
    if (value == nullptr) {
      fail(s.place(),
           fmt::format(
               "needs a frame '{}': {{ body = ..., point = ... }}, or the name of a marker, a body or \"ground\"{}",
               kKeys[k], count == 2 ? ", or the short form bodies = [..], at = [..]" : ""));
    }
    frames.push_back(read_marker(*value, ""));
  }
  return frames;
}

/// The ends of a cable, and the rings between them in their order.
std::vector<MarkerSpec> read_through(Section& s) {
  const Value* list = s.value("through");
  const auto most = static_cast<std::size_t>(FrameBlocks::kMostFrames);
  if (list == nullptr || list->type != Value::Type::array || list->items.size() < 2 || list->items.size() > most)
    fail(list == nullptr ? s.place() : list->place,
         fmt::format(
             "needs 'through', a list of 2 to {} frames: where the cable begins, the rings that it goes through, "
             "and where it ends; each {{ body = ..., point = ... }} or the name of a marker",
             most));
  std::vector<MarkerSpec> frames;
  for (const Value& item : list->items) frames.push_back(read_marker(item, ""));
  return frames;
}

JointSpec read_joint(const std::string& name, const Value& value, Description& model) {
  Section s(value);
  JointSpec j;
  j.place = value.place;
  j.name = name;
  const JointKind& kind = s.row("type", kJointKinds);
  j.type = kind.type;
  j.frames = kind.frames == JointKind::Frames::through ? read_through(s)
                                                       : read_frames(s, kind.frames == JointKind::Frames::four ? 4 : 2);
  j.pull = s.flag("pull", false);
  j.attach = read_attach(s);
  if (kind.read != nullptr) kind.read(s, j, model);
  j.active = s.flag("active", true);
  read_joint_contacts(s, j);
  s.finish();
  return j;
}

void read_spring(Section& s, ForceSpec& f) {
  f.stiffness = s.number("stiffness", 0);
  f.damping = s.number("damping", 0);
  f.rest = read_measure(s, "rest", f.measured);
  f.preload = s.number("preload", 0);
  if (s.has("actuator")) f.formula = {s.place("actuator"), s.state_function("actuator")};
}

/// Three numbers or expressions of quantities: `numbers` where all are numbers, else `formulas` from `first` on.
void read_components(Section& s, const std::string& key, Vec3& numbers, ForceSpec& f, std::size_t first) {
  const Value* list = s.value(key);
  if (list == nullptr) return;
  const auto is_text = [](const Value& item) { return item.type == Value::Type::text; };
  if (list->type != Value::Type::array || list->items.size() != 3 ||
      std::none_of(list->items.begin(), list->items.end(), is_text)) {
    numbers = s.vector(key);
    return;
  }
  for (std::size_t k = 0; k < 3; ++k)
    f.components[first + k] = {list->items[k].place, Section::state_function(list->items[k])};
}

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

void read_cable_force(Section& s, ForceSpec& f) {
  f.stiffness = s.positive("stiffness");
  f.damping = s.number("damping", 0);
  f.rest = read_measure(s, "length", f.measured);
  if (!f.measured && !(f.rest > 0)) fail(s.place("length"), "must be greater than 0");
  f.friction = s.number("friction", 0);
  if (f.damping < 0) fail(s.place("damping"), "must not be negative");
  if (f.friction < 0) fail(s.place("friction"), "must not be negative");
  f.slip_speed = f.friction > 0 ? s.positive("slip_speed") : s.positive("slip_speed", 1);
}

/// A load on the material of a solid.
void read_body_load(Section& s, ForceSpec& f) {
  f.body = s.text("body");
  f.element_set = s.text("element_set", "");
  f.material = {s.vector("acceleration", Vec3::Zero()), s.vector("force_density", Vec3::Zero()),
                s.vector("angular_velocity", Vec3::Zero()), s.vector("point", Vec3::Zero())};
  if (!s.has("acceleration") && !s.has("force_density") && !s.has("angular_velocity"))
    fail(s.place(),
         "needs 'acceleration', 'force_density' (force per volume), or 'angular_velocity' of axes that turn about "
         "'point'; a load on a frame has 'a' instead of 'body'");
  Value one;
  one.type = Value::Type::integer;
  one.integer = 1;
  one.real = 1;
  f.formula = {s.place("factor"), s.has("factor") ? s.state_function("factor") : Section::state_function(one)};
}

ForceSpec read_force(const std::string& name, const Value& value, const std::string& units) {
  Section s(value);
  ForceSpec f;
  f.place = value.place;
  f.name = name;
  f.type = static_cast<ForceType>(s.choice("type", force_type_names()));
  if (f.type == ForceType::pressure) {
    f.body = s.text("body");
    f.face = s.text("face");
    f.formula = {s.place("pressure"), s.state_function("pressure")};
  } else if (f.type == ForceType::load && s.has("body")) {
    read_body_load(s, f);
    f.active = s.flag("active", true);
    s.finish();
    return f;
  } else if (f.type == ForceType::line_load) {
    f.where.place = s.place();
    f.body = f.where.body = s.text("body");
    read_where(s, f.where);
    f.element_set = s.text("element_set", "");
  } else {
    f.frames = f.type == ForceType::cable ? read_through(s) : read_frames(s, f.type == ForceType::load ? 1 : 2);
  }
  switch (f.type) {
    case ForceType::spring:
    case ForceType::axial_spring:
    case ForceType::rotational_spring:
      read_spring(s, f);
      break;
    case ForceType::bushing:
      f.linear = s.vector("stiffness", Vec3::Zero());
      f.linear_damping = s.vector("damping", Vec3::Zero());
      f.angular = s.vector("angular_stiffness", Vec3::Zero());
      f.angular_damping = s.vector("angular_damping", Vec3::Zero());
      break;
    case ForceType::load:
      read_components(s, "force", f.linear, f, 0);
      read_components(s, "moment", f.angular, f, 3);
      if (s.has("factor")) f.formula = {s.place("factor"), s.state_function("factor")};
      f.follower = s.flag("follower", false);
      break;
    case ForceType::line_load:
      f.linear = s.vector("force", Vec3::Zero());
      f.angular = s.vector("moment", Vec3::Zero());
      if (s.has("factor")) f.formula = {s.place("factor"), s.state_function("factor")};
      f.follower = s.flag("follower", false);
      break;
    case ForceType::guide:
      read_guide(s, f, units);
      break;
    case ForceType::torque_motor:
      f.formula = {s.place("torque"), s.state_function("torque")};
      break;
    case ForceType::force_motor:
      f.formula = {s.place("force"), s.state_function("force")};
      break;
    case ForceType::cable:
      read_cable_force(s, f);
      break;
    case ForceType::pressure:
      break;
  }
  f.active = s.flag("active", true);
  s.finish();
  return f;
}

}  // namespace

double read_measure(Section& s, const std::string& key, bool& measured) {
  const Value* value = s.value(key);
  measured = value == nullptr || (value->type == Value::Type::text && value->text == "initial");
  return measured ? 0.0 : s.number(key);
}

const std::vector<std::string>& force_type_names() {
  static const std::vector<std::string> names = {
      "spring", "axial-spring", "rotational-spring", "bushing", "load",     "pressure",
      "guide",  "torque-motor", "force-motor",       "cable",   "line-load"};
  return names;
}

void read_joints(Section& root, Description& model) {
  root.named("joints", [&](const std::string& name, const Value& value) {
    model.joints.push_back(read_joint(name, value, model));
    keep_named_frames(model.joints.back().frames, model);
  });
}

void read_forces(Section& root, Description& model) {
  root.named("forces", [&](const std::string& name, const Value& value) {
    model.forces.push_back(read_force(name, value, model.units));
    keep_named_frames(model.forces.back().frames, model);
  });
}

}  // namespace espalier::dynamics::model
