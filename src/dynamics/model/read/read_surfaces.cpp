// The sections [surfaces] and [contacts].
#include <fmt/format.h>

#include "dense/dense.hpp"
#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {
namespace {

/// Axes whose z is a direction.
Mat3 axes_along(const Vec3& z, const Place& place) {
  if (!(z.norm() > 0)) fail(place, "must not be zero");
  return dense::rotation_between(Vec3::UnitZ(), z);
}

/// `rotation`, or the direction under `key`.
Mat3 read_surface_axes(Section& s, const std::string& key) {
  if (!s.has(key)) return s.rotation("rotation");
  if (s.has("rotation")) fail(s.place("rotation"), fmt::format("does not go with '{}'", key));
  return axes_along(s.vector(key), s.place(key));
}

constexpr int kMostTeeth = 10000;     // each takes about 100 triangles
constexpr int kMostDivisions = 1000;  // of an element, each with five points

void read_faces_surface(Section& s, SurfaceSpec& out, const std::string& /*folder*/) {
  SolidFaces faces;
  faces.set = s.text("set", "");
  faces.divisions = s.integer("divisions", 1, faces.divisions, kMostDivisions);
  out.shape = faces;
}

void read_line_surface(Section& s, SurfaceSpec& out, const std::string& /*folder*/) {
  LineSurface line;
  line.radius = s.positive("radius");
  line.divisions = s.integer("divisions", 1, line.divisions, kMostDivisions);
  out.shape = line;
}

void read_sprocket_surface(Section& s, SurfaceSpec& out, const std::string& /*folder*/) {
  contact::SprocketShape sprocket;
  sprocket.teeth = s.integer("teeth", 6, sprocket.teeth, kMostTeeth);
  sprocket.pitch = s.positive("pitch");
  sprocket.roller_radius = s.positive("roller_radius");
  sprocket.width = s.positive("width");
  sprocket.tip = s.positive("tip", sprocket.tip);
  out.shape = sprocket;
  out.axes = read_surface_axes(s, "axis");
}

void read_plane_surface(Section& s, SurfaceSpec& out, const std::string& /*folder*/) {
  out.shape = contact::Shape(contact::PlaneShape{});
  out.axes = read_surface_axes(s, "normal");
}

void read_sphere_surface(Section& s, SurfaceSpec& out, const std::string& /*folder*/) {
  out.shape = contact::Shape(contact::SphereShape{s.positive("radius")});
}

template <class Shape>
void read_round_surface(Section& s, SurfaceSpec& out, const std::string& /*folder*/) {
  const double radius = s.positive("radius"), half = 0.5 * s.positive("length");
  out.shape = contact::Shape(Shape{radius, half});
  out.axes = read_surface_axes(s, "axis");
}

void read_box_surface(Section& s, SurfaceSpec& out, const std::string& /*folder*/) {
  const Vec3 size = s.vector("size");
  if (!(size.minCoeff() > 0)) fail(s.place("size"), "needs three lengths greater than 0");
  out.shape = contact::Shape(contact::BoxShape{0.5 * size});
  out.axes = s.rotation("rotation");
}

void read_mesh_surface(Section& s, SurfaceSpec& out, const std::string& folder) {
  SurfaceFile file{s.text("file"), Vec3::Ones()};
  if (const Value* scale = s.value("scale"); scale != nullptr && scale->type == Value::Type::array) {
    file.scale = s.vector("scale");
    if (file.scale.prod() == 0) fail(s.place("scale"), "needs three factors, none of them 0");
  } else {
    file.scale.setConstant(s.positive("scale", 1));
  }
  if (!file.path.empty() && file.path.front() != '/' && !folder.empty()) file.path = folder + "/" + file.path;
  out.shape = std::move(file);
  out.axes = s.rotation("rotation");
}

struct ShapeRow {
  const char* name;
  void (*read)(Section& s, SurfaceSpec& out, const std::string& folder);
  bool placed = true;  ///< at a point of its body; others are where the body's elements are
};
constexpr ShapeRow kShapes[] = {{"plane", read_plane_surface},
                                {"sphere", read_sphere_surface},
                                {"capsule", read_round_surface<contact::CapsuleShape>},
                                {"cylinder", read_round_surface<contact::CylinderShape>},
                                {"box", read_box_surface},
                                {"mesh", read_mesh_surface},
                                {"faces", read_faces_surface, false},
                                {"sprocket", read_sprocket_surface},
                                {"line", read_line_surface, false}};

SurfaceSpec read_surface(const std::string& name, const Value& value, const std::string& folder) {
  Section s(value);
  SurfaceSpec out;
  out.place = value.place;
  out.name = name;
  out.body = s.text("body");
  const ShapeRow& shape = s.row("shape", kShapes);
  if (shape.placed) out.point = s.vector("point", Vec3::Zero());
  shape.read(s, out, folder);
  s.finish();
  return out;
}

double number_from_zero(Section& s, const std::string& key) {
  const double value = s.number(key, 0);
  if (value < 0) fail(s.place(key), fmt::format("must not be negative, but is {:g}", value));
  return value;
}

contact::ContactLaw read_contact_law(Section& s) {
  contact::ContactLaw law;
  law.impulse = s.choice("law", {"penalty", "impulse"}, 0) == 1;
  law.stiffness = s.positive("stiffness");
  law.exponent = s.positive("exponent", 1);
  if (!(law.exponent >= 1 && law.exponent <= 4)) fail(s.place("exponent"), "must lie between 1 and 4");
  law.smoothing = number_from_zero(s, "smoothing");
  if (law.smoothing > 0 && law.exponent != 1) fail(s.place("smoothing"), "goes with the exponent 1 only");
  law.damping = number_from_zero(s, "damping");
  law.restitution =
      law.impulse && s.has("restitution") ? number_from_zero(s, "restitution") : s.positive("restitution", 1);
  if (law.restitution > 1)
    fail(s.place("restitution"),
         fmt::format("must lie in {}, not {:g}", law.impulse ? "[0, 1]" : "(0, 1]", law.restitution));
  for (const char* key : {"damping", "smoothing"})
    if (law.impulse && s.has(key))
      fail(s.place(key),
           "does not go with law = \"impulse\", whose stiffness only holds what rests, critically damped");
  if (law.restitution < 1 && law.damping > 0) fail(s.place("damping"), "does not go with 'restitution'");
  law.friction = number_from_zero(s, "friction");
  law.static_friction = number_from_zero(s, "static");
  if (law.static_friction > 0 && law.static_friction < law.friction)
    fail(s.place("static"), "must not be below 'friction', that of sliding");
  if (law.falls()) law.stribeck_speed = s.positive("stribeck_speed");
  if (law.rubs()) {
    // Mindlin: 2 (1 - nu) / (2 - nu) of the normal stiffness, 0.82 for nu = 0.3
    constexpr double kMindlin = 0.8;
    if (law.exponent != 1 && !s.has("tangential_stiffness"))
      fail(s.place(), "needs 'tangential_stiffness': with this exponent it does not follow from the stiffness");
    law.tangential_stiffness = s.positive("tangential_stiffness", kMindlin * law.stiffness);
    law.tangential_damping = number_from_zero(s, "tangential_damping");
  }
  return law;
}

ContactSpec read_contact(const std::string& name, const Value& value) {
  Section s(value);
  ContactSpec out;
  out.place = value.place;
  out.name = name;
  out.active = s.flag("active", true);
  out.surfaces = s.texts("surfaces");
  out.against = s.texts("against");
  out.self = s.flag("self", false);
  if (out.surfaces.empty()) fail(s.place("surfaces"), "needs 'surfaces', the names of at least one of [surfaces]");
  out.law = read_contact_law(s);
  out.margin = s.positive("margin", 0);
  if (s.has("overlap")) out.overlap = number_from_zero(s, "overlap");
  out.penetration = s.positive("penetration", 0);
  s.finish();
  return out;
}

}  // namespace

void read_surfaces(Section& root, Description& model) {
  root.named("surfaces", [&](const std::string& name, const Value& value) {
    model.surfaces.push_back(read_surface(name, value, model.folder));
  });
  root.named("contacts",
             [&](const std::string& name, const Value& value) { model.contacts.push_back(read_contact(name, value)); });
}

}  // namespace espalier::dynamics::model
