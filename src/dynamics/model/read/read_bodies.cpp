// The section [bodies].
#include "dynamics/model/build/body_demand.hpp"
#include "dynamics/model/read/body_readers.hpp"

namespace espalier::dynamics::model {
namespace {

/// A kind of body: what it is called, what reads it, and whether it moves by nodes, whose motion, damping and reduction
/// have the same keys in all of these.
struct BodyRow {
  const char* name;
  BodyShape (*read)(Section& s, BodyMaterials& materials);
  bool flexible = true;
};
constexpr BodyRow kBodies[] = {{"rigid", read_rigid, false},
                               {"solid", read_solid},
                               {"cable", read_cable},
                               {"beam", read_beam},
                               {"shell", read_shell},
                               {"point", read_point, false},
                               {"substructure", read_substructure}};

void read_motion(Section& s, BodySpec& body) {
  body.position = s.vector("position", Vec3::Zero());
  body.rotation = s.rotation("rotation");
  body.velocity = s.vector("velocity", Vec3::Zero());
  body.angular_velocity = s.vector("angular_velocity", Vec3::Zero());
  read_body_damping(s, body);
}

BodySpec read_body(const std::string& name, const Value& value, BodyMaterials& materials) {
  Section s(value);
  BodySpec body;
  body.place = value.place;
  body.name = name;
  body.velocity_given = s.has("velocity");
  body.angular_velocity_given = s.has("angular_velocity");
  if (s.has("gravity")) body.gravity = s.vector("gravity");
  const BodyRow& kind = s.row("type", kBodies);
  if (kind.flexible) read_motion(s, body);
  body.shape = kind.read(s, materials);
  s.finish();
  body.massless = materials.take_massless();
  return body;
}

}  // namespace

void read_bodies(Section& root, Description& model) {
  BodyMaterials materials(root, model);
  MemoryDemand demand;
  root.named("bodies", [&](const std::string& name, const Value& value) {
    BodySpec body = read_body(name, value, materials);
    demand.add(body);
    model.bodies.push_back(std::move(body));
  });
}

}  // namespace espalier::dynamics::model
