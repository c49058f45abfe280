// The sections [markers], [joints] and [forces].
#include <fmt/format.h>

#include "dynamics/model/description.hpp"
#include "dynamics/model/force_kinds/kind.hpp"
#include "dynamics/model/frames/names.hpp"
#include "dynamics/model/frames/read_marker.hpp"
#include "dynamics/model/joint_kinds/kind.hpp"

namespace espalier::dynamics::model {
namespace {

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

ForceSpec read_force(const std::string& name, const Value& value, const std::string& units) {
  Section s(value);
  ForceSpec f;
  f.place = value.place;
  f.name = name;
  const ForceKind& kind = s.row("type", kForceKinds);
  f.type = kind.type;
  if (kind.frames == ForceKind::Frames::two) f.frames = read_frames(s, 2);
  if (kind.frames == ForceKind::Frames::through) f.frames = read_through(s);
  kind.read(s, f, units);
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
