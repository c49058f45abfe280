// Bodies without elements: rigid ones, and points.
#include <fmt/format.h>

#include <utility>

#include "dynamics/contact/geometry/surface_inertia.hpp"
#include "dynamics/model/read/body_readers.hpp"

namespace espalier::dynamics::model {
namespace {

/// File and scale of a closed surface.
std::pair<std::string, double> read_closed_surface(Section& mesh, const Description& model) {
  std::pair<std::string, double> found = {beside_model(model, mesh.text("file")), mesh.positive("scale", 1)};
  mesh.finish();
  return found;
}

void read_rigid_motion(Section& s, RigidSpec& r) {
  r.data.rotation = quaternion_of(s.rotation("rotation"));
  r.data.velocity = s.vector("velocity", Vec3::Zero());
  r.data.angular_velocity = s.vector("angular_velocity", Vec3::Zero());
}

/// A uniform solid inside a closed surface of a file; its centre of mass stands where the file puts it.
RigidSpec read_rigid_of_surface(Section& s, const Description& model) {
  for (const char* other : {"inertia", "box"})
    if (s.has(other)) fail(s.place(other), "does not go with 'mesh', which gives the inertia and the shape");
  if (s.has("mass") == s.has("density")) fail(s.place(), "needs one of 'mass' and 'density' beside 'mesh'");
  auto mesh = s.table("mesh");
  const auto [file, scale] = read_closed_surface(*mesh, model);
  RigidSpec r;
  const contact::SurfaceSolid solid = contact::solid_inside(contact::read_surface(file, scale), file);
  r.data.mass = s.has("mass") ? s.positive("mass") : s.positive("density") * solid.volume;
  r.data.inertia = r.data.mass / solid.volume * solid.inertia;
  r.box = solid.extents;
  r.data.position = s.vector("position", solid.centre);
  read_rigid_motion(s, r);
  return r;
}

}  // namespace

BodyShape read_rigid(Section& s, BodyMaterials& materials) {
  if (s.has("mesh")) return read_rigid_of_surface(s, materials.model());
  RigidSpec r;
  r.data.mass = s.positive("mass");
  if (s.has("box")) {
    r.box = s.vector("box");
    if (!(r.box->minCoeff() > 0)) fail(s.place("box"), "needs three lengths greater than 0");
  }
  if (!s.has("inertia") && !r.box) fail(s.place(), "needs 'inertia', or 'box' = [x, y, z], from which it follows");
  if (s.has("inertia")) {
    r.data.inertia = s.matrix("inertia");
  } else {  // a uniform block
    const Vec3 square = r.box->cwiseAbs2();
    r.data.inertia = Vec3(square.sum() * Vec3::Ones() - square).asDiagonal();
    r.data.inertia *= r.data.mass / 12;
  }
  if (!(r.data.inertia.diagonal().minCoeff() > 0))
    fail(s.place("inertia"),
         "needs moments of inertia greater than 0; a body without extension still needs small ones");
  r.data.position = s.vector("position", Vec3::Zero());
  read_rigid_motion(s, r);
  return r;
}

BodyShape read_point(Section& s, BodyMaterials& /*materials*/) {
  PointSpec p;
  p.data.mass = s.positive("mass");
  p.data.position = s.vector("position", Vec3::Zero());
  p.data.velocity = s.vector("velocity", Vec3::Zero());
  return p;
}

}  // namespace espalier::dynamics::model
