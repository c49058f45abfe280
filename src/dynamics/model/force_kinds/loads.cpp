// Loads on a place, along a line, on a face, and on material.
#include <algorithm>

#include "dynamics/model/force_kinds/kind.hpp"
#include "dynamics/model/frames/read_marker.hpp"

namespace espalier::dynamics::model {
namespace {

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

void read_load(Section& s, ForceSpec& f, const std::string& /*units*/) {
  if (s.has("body")) return read_body_load(s, f);
  f.frames = read_frames(s, 1);
  read_components(s, "force", f.linear, f, 0);
  read_components(s, "moment", f.angular, f, 3);
  if (s.has("factor")) f.formula = {s.place("factor"), s.state_function("factor")};
  f.follower = s.flag("follower", false);
}

void read_line_load(Section& s, ForceSpec& f, const std::string& /*units*/) {
  f.where.place = s.place();
  f.body = f.where.body = s.text("body");
  read_where(s, f.where);
  f.element_set = s.text("element_set", "");
  f.linear = s.vector("force", Vec3::Zero());
  f.angular = s.vector("moment", Vec3::Zero());
  if (s.has("factor")) f.formula = {s.place("factor"), s.state_function("factor")};
  f.follower = s.flag("follower", false);
}

void read_pressure(Section& s, ForceSpec& f, const std::string& /*units*/) {
  f.body = s.text("body");
  f.face = s.text("face");
  f.formula = {s.place("pressure"), s.state_function("pressure")};
}

/// The order of the inputs is that of build_functions(): components, then the factor.
std::unique_ptr<FrameForce> make_load(const ForceSpec& f, FramePtr a, FramePtr /*b*/, const ForceStart& start) {
  LoadLaw law;
  law.force = f.linear;
  law.moment = f.angular;
  law.follower = f.follower;
  int next = 0;
  for (std::size_t k = 0; k < 6; ++k)
    if (f.components[k]) law.input[k] = next++;
  if (f.formula || start.driven) law.input[6] = next;
  return load(f.name, std::move(a), law);
}

}  // namespace

const ForceKind kLoad = {.type = ForceType::load,
                         .name = "load",
                         .read = read_load,
                         .make = make_load,
                         .frames = ForceKind::Frames::none,
                         .factor = 1};

const ForceKind kPressure = {
    .type = ForceType::pressure, .name = "pressure", .read = read_pressure, .frames = ForceKind::Frames::none};

const ForceKind kLineLoad = {.type = ForceType::line_load,
                             .name = "line-load",
                             .read = read_line_load,
                             .frames = ForceKind::Frames::none,
                             .factor = 1};

}  // namespace espalier::dynamics::model
