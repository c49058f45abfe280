#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <numbers>
#include <numeric>

#include "dynamics/mesh/file_source.hpp"
#include "dynamics/mesh/names.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/sides.hpp"
#include "dynamics/model/assembly/line_body.hpp"
#include "dynamics/model/assembly/shell_body.hpp"
#include "dynamics/model/assembly/solid_materials.hpp"
#include "dynamics/model/build/builders.hpp"
#include "dynamics/model/decks/taken.hpp"

namespace espalier::dynamics::model {
namespace {

Point to_point(const Vec3& x) { return {x.x(), x.y(), x.z()}; }

Mesh make_part(const MesherSpec& part, base::ThreadPool& pool) {
  MeshSize own = part.size;
  own.pool = &pool;
  struct Visitor {
    const MeshSize& size;
    Mesh operator()(const BlockMesh& b) const {
      return b.divisions[0] > 0 ? make_block(b.shape, b.divisions[0], b.divisions[1], b.divisions[2], size.type)
                                : make_block(b.shape, size);
    }
    Mesh operator()(const RodShape& s) const { return make_connecting_rod(s, size); }
    Mesh operator()(const LinkShape& s) const { return make_chain_link(s, size); }
    Mesh operator()(const CrankShape& s) const { return make_crank(s, size); }
    Mesh operator()(const GuideShape& s) const { return make_guide(s, size); }
    Mesh operator()(const RotorShape& s) const { return make_bladed_rotor(s, size); }
    Mesh operator()(const GearMesh& g) const {
      return g.divisions[0] > 0 ? make_spur_gear(g.shape, g.divisions[0], g.divisions[1], g.divisions[2], size.type)
                                : make_spur_gear(g.shape, size);
    }
    Mesh operator()(const TyreMesh& t) const {
      return t.divisions[0] > 0 ? make_tyre(t.shape, t.divisions[0], t.divisions[1], t.divisions[2], size.type)
                                : make_tyre(t.shape, size);
    }
  };
  return std::visit(Visitor{own}, part.shape);
}

Mesh load_mesh(const MeshFile& file, const std::string& body) {
  if (!file_exists(file.path))
    throw Error(StatusCode::invalid_input,
                fmt::format("there is no mesh file '{}'; paths are relative to the folder of the model", file.path));
  Mesh mesh = mesh_of_file(file, body);
  for (Point& p : mesh.nodes)
    for (double& x : p) x *= file.scale;
  mesh.drop_unused_nodes();
  add_side_sets(mesh);
  return mesh;
}

/// The solids among elements that may be surfaces, lines and points too. Those that lie on the solids are sets alone
/// (Gmsh writes .inp files so), the others are passed over: the notices count both.
/// @param chosen  rising; empty: all. @return empty: all elements of the mesh
std::vector<Index> solids_of(Mesh& mesh, std::vector<Index> chosen) {
  const bool all = chosen.empty();
  if (all) {
    chosen.resize(at(mesh.element_count()));
    std::iota(chosen.begin(), chosen.end(), 0);
  }
  std::vector<Index> solids;
  std::vector<char> of_solids(mesh.nodes.size(), 0);
  for (const Index e : chosen) {
    if (shape_of(mesh.type(e)).dimension < 3) continue;
    solids.push_back(e);
    for (const Index n : mesh.element(e)) of_solids[at(n)] = 1;
  }
  if (solids.empty() || solids.size() == chosen.size()) return all ? std::vector<Index>() : chosen;
  Index on_solids = 0;
  std::map<std::string_view, Index> others;  // by their shapes
  for (const Index e : chosen) {
    const auto nodes = mesh.element(e);
    if (shape_of(mesh.type(e)).dimension == 3) continue;
    if (std::all_of(nodes.begin(), nodes.end(), [&](Index n) { return of_solids[at(n)] != 0; }))
      ++on_solids;
    else
      ++others[shape_of(mesh.type(e)).name];
  }
  if (on_solids > 0)
    mesh.notices.push_back(
        fmt::format("{} surface and line elements that lie on the solids serve as sets only", on_solids));
  if (!others.empty()) {
    std::string list;
    for (const auto& [shape, count] : others) list += fmt::format("{}{} {}", list.empty() ? "" : ", ", count, shape);
    mesh.notices.push_back(fmt::format("elements that are no solids are passed over: {}; the body is made of {} solids",
                                       list, solids.size()));
  }
  return solids;
}

/// Without other elements where they have nodes of their own: such nodes would be masses without stiffness.
void drop_others(Mesh& mesh, std::vector<Index>& elements) {
  if (elements.empty()) return;
  std::vector<char> used(mesh.nodes.size(), 0);
  for (const Index e : elements)
    for (const Index n : mesh.element(e)) used[at(n)] = 1;
  if (std::find(used.begin(), used.end(), 0) == used.end()) return;
  keep_elements(mesh, elements);
  mesh.drop_unused_nodes();
  elements.clear();
}

std::string pieces_of(const Mesh& mesh, std::span<const Index> elements) {
  constexpr std::size_t kShown = 5;
  const std::vector<Index> first = mesh.pieces(elements);
  if (first.size() < 2) return "";
  std::string labels;
  for (std::size_t k = 0; k < std::min(kShown, first.size()); ++k)
    labels += fmt::format("{}{}", k > 0 ? ", " : "", node_name(mesh, first[k]));
  return fmt::format(
      "the mesh falls into {} pieces that share no node, with the nodes {}{}; where joints do not hold all of them, "
      "they move "
      "apart",
      first.size(), labels, first.size() > kShown ? ", ..." : "");
}

/// The same mesh for bodies that are copies of each other (links of a chain) would be made many times; it is cheap
/// beside one factorization.
std::unique_ptr<FlexibleBody> make_solid(const BodySpec& spec, const SolidSpec& solid, bool statics,
                                         base::ThreadPool& pool, BuiltBody& out) {
  const auto* file = std::get_if<MeshFile>(&solid.mesh);
  auto mesh = std::make_shared<Mesh>(file != nullptr ? load_mesh(*file, spec.name)
                                                     : make_part(std::get<MesherSpec>(solid.mesh), pool));
  std::vector<Index> elements =
      solids_of(*mesh, solid.element_set.empty() ? std::vector<Index>() : mesh->element_set(solid.element_set));
  drop_others(*mesh, elements);
  const ElementMaterials materials = solid_materials(*mesh, solid, elements, statics, out.spec.massless);
  out.material = materials.list.front();
  std::vector<double> reference;
  for (const Point& p : mesh->nodes) reference.insert(reference.end(), p.begin(), p.end());
  auto body = std::make_unique<FlexibleBody>(
      spec.name, 1, std::move(reference), make_solid_groups(*mesh, elements, materials, solid.options, &pool), &pool);
  out.notices = mesh->notices;
  if (file != nullptr) {  // meshers refuse to make elements that are folded
    std::string folds = corner_folds(*mesh, elements, &pool);
    if (!folds.empty()) out.notices.push_back(std::move(folds));
  }
  out.pieces = pieces_of(*mesh, elements);
  if (!out.pieces.empty()) out.notices.push_back(out.pieces);
  out.mesh = std::move(mesh);
  return body;
}

std::unique_ptr<FlexibleBody> make_flexible_body(const BodySpec& spec, bool statics, base::ThreadPool& pool,
                                                 BuiltBody& out) {
  if (const auto* solid = std::get_if<SolidSpec>(&spec.shape)) return make_solid(spec, *solid, statics, pool, out);
  if (line_file(out) != nullptr) return make_lines(spec, statics, out);
  if (const auto* c = std::get_if<CableSpec>(&spec.shape))
    return make_cable_body(spec.name, to_point(c->start), to_point(c->end), c->elements, c->section);
  if (const auto* b = std::get_if<BeamSpec>(&spec.shape))
    return make_beam_body(spec.name, *b->axis, to_point(b->y), b->elements, b->section);
  return make_shell(spec, statics, out);
}

}  // namespace

Mesh mesh_of_file(const MeshFile& file, const std::string& body) {
  if (file.take.empty()) return read_mesh(file.path);
  Deck deck = read_deck(file.path, file.step);
  TakenDeck taken = take_deck(deck, choice_of(file.take), file.owner.empty() ? body : file.owner);
  Mesh mesh = std::move(deck.mesh);
  complete_sets(mesh);
  for (auto& [name, nodes] : taken.node_sets) {
    sort_unique(nodes);
    mesh.node_sets[name] = std::move(nodes);
  }
  for (auto& [name, elements] : taken.element_sets) {
    sort_unique(elements);
    mesh.element_sets[name] = std::move(elements);
  }
  for (auto& [name, faces] : taken.face_sets) mesh.face_sets[name] = std::move(faces);
  if (file.owner.empty()) mesh.notices.insert(mesh.notices.end(), taken.notices.begin(), taken.notices.end());
  if (!file.owner.empty()) mesh.notices.clear();  // which the owner has
  return mesh;
}

RayleighDamping body_damping(const BodySpec& spec, const Description& model) {
  RayleighDamping out = spec.damping;
  if (spec.loss_factor == 0 || !model.moves || model.statics) return out;
  if (spec.loss_frequency == 0)
    fail(spec.place,
         "structural damping (loss_factor) is that of frequency responses and modes: no motion in time has it. Give "
         "'frequency' in 'damping', where viscous damping of the stiffness is the same in a motion, or take ratio = "
         "loss_factor / 2 instead");
  out.stiffness += spec.loss_factor / (2 * std::numbers::pi * spec.loss_frequency);
  return out;
}

BuiltBody build_body(const BodySpec& spec, const Description& model, const FrameBuilder& frames, Mechanism& out) {
  BuiltBody built;
  built.spec = spec;
  const Vec3 gravity = spec.gravity.value_or(model.gravity);
  if (const auto* rigid = std::get_if<RigidSpec>(&spec.shape)) {
    RigidBodyData data = rigid->data;
    data.gravity = gravity;
    built.rigid = &out.system.add(std::make_unique<RigidBody>(spec.name, data));
    return built;
  }
  if (const auto* point = std::get_if<PointSpec>(&spec.shape)) {
    PointMassData data = point->data;
    data.gravity = gravity;
    built.point = &out.system.add(std::make_unique<PointMass>(spec.name, data));
    return built;
  }
  if (std::holds_alternative<SubstructureSpec>(spec.shape)) {
    at_place(spec.place, [&] { build_substructure(model, out, built); });
    return built;
  }
  auto body = make_flexible_body(spec, model.statics.has_value(), out.pool, built);
  if (built.spec.massless && !(gravity.isZero(0) && model.initial.modes == 0 && !model.harmonic))
    fail(spec.place, "needs a density, which its mesh file does not state: give it a material");
  if (spec.reduction) {
    reduce_body(std::move(body), model, frames, out, built);
    return built;
  }
  body->set_damping(body_damping(spec, model));
  body->set_gravity(to_point(gravity));
  body->set_pool(&out.pool);
  std::array<double, 9> rows{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) rows[at(3 * i + j)] = spec.rotation(i, j);
  // The text gives the velocity of the body's own origin, the library wants that of the point at the global origin.
  const Vec3 at_origin = spec.velocity - spec.angular_velocity.cross(spec.position);
  body->set_initial_motion(rows, to_point(spec.position), to_point(at_origin), to_point(spec.angular_velocity));
  built.flexible = &out.system.add(std::move(body));
  join_lines(built, out);
  return built;
}

}  // namespace espalier::dynamics::model
