// Solids of elements, and bodies given by their matrices.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/model/read/body_readers.hpp"

namespace espalier::dynamics::model {
namespace {

SubstructureSpec::Matrix read_matrix(const Section& body, std::optional<Section> s, const Description& model) {
  if (!s) fail(body.place(), "needs 'stiffness' and 'mass': { file = \"...\", name = \"...\" } each");
  SubstructureSpec::Matrix m{s->place(), beside_model(model, s->text("file")), s->text("name", "")};
  s->finish();
  return m;
}

SubstructureNode read_node(const Value& value) {
  Section s(value);
  SubstructureNode node;
  if (!s.has("label")) fail(s.place(), "needs 'label', a whole number");
  node.label = s.integer("label", 1, 1);
  node.position = s.vector("position");
  node.components = s.integer("components", 3, 0);
  if (node.components != 0 && node.components != 3 && node.components != 6)
    fail(s.place("components"), "must be 6 (displacement and rotation) or 3 (displacement alone)");
  s.finish();
  return node;
}

void read_lines(Section& s, SubstructureSpec& out) {
  const std::vector<double> labels = s.numbers("lines");
  const auto whole = [](double x) { return std::abs(x) < 1e15 && x == std::floor(x); };
  if (labels.size() % 2 != 0 || !std::all_of(labels.begin(), labels.end(), whole))
    fail(s.place("lines"), "needs two labels of nodes for every line: [1, 2, 2, 3]");
  for (std::size_t k = 0; k < labels.size(); k += 2)
    out.lines.push_back({static_cast<std::int64_t>(labels[k]), static_cast<std::int64_t>(labels[k + 1])});
}

}  // namespace

BodyShape read_solid(Section& s, BodyMaterials& materials) {
  SolidSpec solid;
  const auto mesh = s.table("mesh");
  if (!mesh) fail(s.place(), "needs 'mesh': { file = \"...\" } or { part = \"...\", unknowns = ... }");
  solid.mesh = read_mesh_source(*mesh, materials.model());
  solid.material = materials.material(s);
  materials.read_sets(s, solid);
  if (!solid.material && !std::holds_alternative<MeshFile>(solid.mesh)) fail(s.place(), kNeedsMaterial);
  solid.element_set = s.text("element_set", "");
  solid.options.hex8 = s.one_of("hex8", kHex8Formulations, solid.options.hex8);
  solid.options.reduced_hex20 = s.flag("reduced_hex20", false);
  if (auto e = s.table("erosion")) solid.erosion = read_erosion(*e);
  return solid;
}

BodyShape read_substructure(Section& s, BodyMaterials& materials) {
  SubstructureSpec out;
  out.stiffness = read_matrix(s, s.table("stiffness"), materials.model());
  out.mass = read_matrix(s, s.table("mass"), materials.model());
  const Value* nodes = s.value("nodes");
  if (nodes == nullptr)
    fail(s.place(), "needs 'nodes': [{ label = 1, position = [x, y, z] }, ...] or { file = \"...\" } with GRID cards");
  if (nodes->type == Value::Type::table) {
    Section file(*nodes);
    out.nodes_path = beside_model(materials.model(), file.text("file"));
    file.finish();
  } else {
    if (nodes->type != Value::Type::array) fail(nodes->place, "must be a list of nodes or { file = \"...\" }");
    for (const Value& value : nodes->items) out.nodes.push_back(read_node(value));
  }
  if (s.has("lines")) read_lines(s, out);
  return out;
}

}  // namespace espalier::dynamics::model
